#include "sensing/markers/label/label_check.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr int kCell = 4;              // px
constexpr double kSamePlacePx = 1.5;  // two labels nearer than that are on one spot

void Doubt(size_t a, size_t b, const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful) {
  if (fresh[a] >= fresh[b]) doubtful[a] = 1;
  if (fresh[b] >= fresh[a]) doubtful[b] = 1;
}

}  // namespace

LabelCheck::LabelCheck(const LinkModel& model, const StereoRig& rig, LabelCheckOptions options)
    : options_(options),
      paths_(model.markers.paths),
      rings_(model.markers.rings()),
      tube_radius_mm_(model.tube_outer_radius_mm),
      rest_mm_(model.RestMarkers()) {
  const auto& z = model.markers.rings_z_mm;
  for (size_t j = 0; j < z.size(); ++j) {
    double pitch = model.length_mm;
    if (j > 0) pitch = std::min(pitch, z[j] - z[j - 1]);
    if (j + 1 < z.size()) pitch = std::min(pitch, z[j + 1] - z[j]);
    ring_pitch_mm_.push_back(pitch);
  }
  for (const CameraId id : kBothCameras) {
    View view{.projector = Projector(rig[id]), .sizes_px = {}, .directions = {}, .cells = {}};
    view.columns = rig[id].width_px / kCell + 3, view.rows = rig[id].height_px / kCell + 3;
    const int cells = view.columns * view.rows;
    view.cells.assign(static_cast<size_t>(cells), -1);
    for (int l = 0; l < paths_; ++l) {
      // Between the two outermost rings that the lens sees.
      std::optional<Vec2> first, last;
      for (int j = 0; j < rings_; ++j) {
        const auto pixel = view.projector.Project(rest_mm_[static_cast<size_t>(model.MarkerIndex(l, j))]);
        if (!pixel) continue;
        if (!first) first = pixel;
        last = pixel;
      }
      const Vec2 way = first && last ? Vec2(*last - *first) : Vec2(Vec2::Zero());
      view.directions.push_back(way.norm() > 1 ? Vec2(way.normalized()) : Vec2(Vec2::Zero()));
    }
    for (const Vec3& p : rest_mm_) {
      const auto seen = view.projector.ProjectWithJacobian(p);
      view.sizes_px.push_back(seen ? model.markers.diameter_mm * seen->jacobian.rowwise().norm().maxCoeff()
                                   : 0);
    }
    views_.push_back(std::move(view));
  }
}

LabelCheck::Pair LabelCheck::CheckPair(int marker, const std::array<Vec2, kCameraCount>& pixels,
                                       double sigma_px) const {
  std::array<SightRay, kCameraCount> rays;
  for (const CameraId id : kBothCameras) {
    const Projector& projector = views_[Index(id)].projector;
    const auto direction = projector.Ray(pixels[Index(id)]);
    if (!direction) return {};
    rays[Index(id)] = {projector.center_in_link(), *direction};
  }
  const auto meeting = MeetRays(rays[0], rays[1]);
  if (!meeting) return {};
  const Vec3& p = meeting->point_mm;
  const Vec3& rest = rest_mm_[static_cast<size_t>(marker)];
  const double mm_per_px = (p - rays[0].origin).norm() / views_[0].projector.model().lens.focal_px +
                           (p - rays[1].origin).norm() / views_[1].projector.model().lens.focal_px;
  const double radius = p.head<2>().norm(), rest_radius = rest.head<2>().norm();
  const bool holds = meeting->gap_mm < options_.max_ray_gap_mm + 3 * sigma_px * mm_per_px &&
                     std::abs(p.z() - rest.z()) <
                         options_.max_z_error * ring_pitch_mm_[static_cast<size_t>(marker / paths_)] &&
                     radius > 0.8 * tube_radius_mm_ && radius < rest_radius + options_.max_outward_mm &&
                     p.head<2>().dot(rest.head<2>()) > radius * rest_radius * std::cos(kPi / paths_);
  return {holds, p};
}

double LabelCheck::SlipMm(CameraId id, int marker, const Vec3& point_mm) const {
  const double radius = point_mm.head<2>().norm();
  std::array<double, kCameraCount> tangent;  // of the rays against the axis
  for (const CameraId camera : kBothCameras) {
    const double away = std::abs(point_mm.z() - views_[Index(camera)].projector.center_in_link().z());
    tangent[Index(camera)] = radius / std::max(away, 1.0);
  }
  return ring_pitch_mm_[static_cast<size_t>(marker / paths_)] * tangent[Index(id)] /
         (tangent[0] + tangent[1]);
}

void LabelCheck::CheckPicture(CameraId id, const std::vector<MarkerObservation>& labels,
                              const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful) {
  View& view = views_[Index(id)];
  CheckOrder(id, labels, fresh, doubtful);
  CheckSharing(view, labels, fresh, doubtful);
}

// A camera on the axis sees no two points of a path in reverse order.
void LabelCheck::CheckOrder(CameraId id, const std::vector<MarkerObservation>& labels,
                            const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful) const {
  const View& view = views_[Index(id)];
  for (int l = 0; l < paths_; ++l) {
    const Vec2& direction = view.directions[static_cast<size_t>(l)];
    size_t before = labels.size();
    double place_before = 0;
    for (int j = 0; j < rings_; ++j) {
      const int marker = j * paths_ + l;
      const auto i = static_cast<size_t>(marker);
      if (!labels[i].seen) continue;
      const double place = labels[i].center_px.dot(direction);
      if (before < labels.size() && place < place_before + options_.min_step_px) {
        Doubt(i, before, fresh, doubtful);
      } else if (before < labels.size()) {
        const double apart = LeastDistancePx(id, static_cast<int>(i));
        const bool touch = (labels[i].center_px - labels[before].center_px).squaredNorm() < apart * apart;
        if (touch) doubtful[id == CameraId::kTop ? i : before] = 1;
      }
      before = i;
      place_before = place;
    }
  }
}

void LabelCheck::CheckSharing(View& view, const std::vector<MarkerObservation>& labels,
                              const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful) {
  const auto cell_of = [&](const Vec2& p) {
    const int x = std::clamp(static_cast<int>(p.x()) / kCell + 1, 1, view.columns - 2);
    const int y = std::clamp(static_cast<int>(p.y()) / kCell + 1, 1, view.rows - 2);
    return y * view.columns + x;
  };
  for (size_t i = 0; i < labels.size(); ++i) {
    if (!labels[i].seen) continue;
    const int cell = cell_of(labels[i].center_px);
    for (int dy = -1; dy <= 1; ++dy) {
      const int16_t* at = view.cells.data() + cell + dy * view.columns;
      for (int dx = -1; dx <= 1; ++dx) {
        if (at[dx] < 0) continue;
        const auto other = static_cast<size_t>(at[dx]);
        if ((labels[other].center_px - labels[i].center_px).squaredNorm() > kSamePlacePx * kSamePlacePx)
          continue;
        Doubt(i, other, fresh, doubtful);
      }
    }
    view.cells[static_cast<size_t>(cell)] = static_cast<int16_t>(i);
  }
  for (const MarkerObservation& label : labels) {
    if (label.seen) view.cells[static_cast<size_t>(cell_of(label.center_px))] = -1;
  }
}

}  // namespace taclink
