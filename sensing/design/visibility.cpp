#include "sensing/design/visibility.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "sensing/camera/dome.h"
#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr int kDomeLatitudes = 6, kDomeLongitudes = 16;  // samples of a dome
constexpr int kSightSamples = 256;                       // samples of a line of sight
constexpr double kCenterHeight = 4 / (3 * kPi);          // of a half disc's centroid, in radii
// A wall that reaches this far over the line of sight hides less than half a dome.
constexpr double kGrazingMm = 0.02;
constexpr int kBlindSamples = 400, kBlindAngles = 24;

struct Outline {
  Vec2 center = Vec2::Zero();
  std::vector<Vec2> points;

  /// Largest extent from its center in a direction.
  double Reach(const Vec2& direction) const {
    double reach = 0;
    for (const Vec2& p : points) reach = std::max(reach, (p - center).dot(direction));
    return reach;
  }
};

// None unless all samples project: a partial outline would be too small.
std::optional<Outline> OutlineOf(const Projector& camera, const SkinGeometry& geometry, int marker) {
  const auto m = static_cast<size_t>(marker);
  const Vec3& up = geometry.inward[m];
  const Vec3 e = up.unitOrthogonal(), f = up.cross(e);
  Outline outline;
  const Vec3 center = SeenOfDome(geometry.OnDome(marker, kCenterHeight * geometry.dome_radius_mm), up,
                                 kCenterHeight * geometry.dome_radius_mm, camera.center_in_link());
  const auto seen = camera.Project(center);
  if (!seen) return std::nullopt;
  outline.center = *seen;
  for (int i = 0; i <= kDomeLatitudes; ++i) {
    const double latitude = kPi / 2 * i / kDomeLatitudes;
    for (int j = 0; j < kDomeLongitudes; ++j) {
      const double longitude = 2 * kPi * j / kDomeLongitudes;
      const Vec3 unit =
          std::sin(latitude) * up + std::cos(latitude) * (std::cos(longitude) * e + std::sin(longitude) * f);
      const auto pixel = camera.Project(geometry.feet[m] + geometry.dome_radius_mm * unit);
      if (!pixel) return std::nullopt;
      outline.points.push_back(*pixel);
    }
  }
  return outline;
}

// Smallest distance between the wall and the line from a point to a camera, where it is between the skin's
// ends; infinite where it is nowhere.
double ClearanceMm(const SkinGeometry& geometry, const Vec3& point, const Vec3& camera) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 1; i < kSightSamples; ++i) {
    const Vec3 at = point + (camera - point) * i / kSightSamples;
    if (at.z() < 0 || at.z() > geometry.length_mm) continue;
    const double radius = at.head<2>().norm();
    least = std::min(least, geometry.WallRadius(at.z(), std::atan2(at.y(), at.x())) - radius);
  }
  return least;
}

bool IsBehindTube(const SkinGeometry& geometry, const Vec3& point, const Vec3& camera) {
  if (geometry.tube_radius_mm <= 0) return false;
  const double block_z = geometry.length_mm / 2;
  const double share = (block_z - point.z()) / (camera.z() - point.z());
  if (!(share > 0 && share < 1)) return false;
  return (point + share * (camera - point)).head<2>().norm() < geometry.tube_radius_mm;
}

double MarginPx(const Projector& camera, const Outline& outline) {
  double margin = std::numeric_limits<double>::infinity();
  const CameraModel& model = camera.model();
  for (const Vec2& p : outline.points) {
    margin = std::min(
        {margin, p.x() + 0.5, p.y() + 0.5, model.width_px - 0.5 - p.x(), model.height_px - 0.5 - p.y()});
  }
  return margin;
}

MarkerView ViewOf(const Projector& camera, const SkinGeometry& geometry, int marker,
                  std::optional<Outline>& outline) {
  MarkerView view;
  const auto m = static_cast<size_t>(marker);
  const Vec3& eye = camera.center_in_link();
  outline = OutlineOf(camera, geometry, marker);
  if (!outline) return view;
  view.center_px = outline->center;
  const Vec2 off = outline->center - camera.model().lens.principal_point_px;
  const Vec2 along = off.norm() > 1e-9 ? Vec2(off.normalized()) : Vec2(Vec2::UnitX());
  const Vec2 across(-along.y(), along.x());
  view.along_px = outline->Reach(along) + outline->Reach(-along);
  view.across_px = outline->Reach(across) + outline->Reach(-across);
  view.margin_px = MarginPx(camera, *outline);
  const Vec3 center = geometry.OnDome(marker, kCenterHeight * geometry.dome_radius_mm);
  view.clearance_mm = ClearanceMm(geometry, center, eye);
  if (view.clearance_mm < -kGrazingMm) {
    view.sight = Sight::kBehindWall;
  } else if ((eye - geometry.feet[m]).dot(geometry.inward[m]) <= 0) {
    view.sight = Sight::kTurnedAway;
  } else if (IsBehindTube(geometry, center, eye)) {
    view.sight = Sight::kBehindTube;
  } else {
    view.sight = view.margin_px < 0 ? Sight::kOutsideImage : Sight::kSeen;
  }
  return view;
}

// Distance of convex outlines by separating axes: the widest gap along any axis. These three axes suffice for
// ellipses that lie along or across the image radius.
double GapPx(const Outline& a, const Outline& b, const Vec2& principal_point) {
  const Vec2 between = b.center - a.center;
  const Vec2 along = (0.5 * (a.center + b.center) - principal_point).normalized();
  double gap = -std::numeric_limits<double>::infinity();
  for (Vec2 axis : {Vec2(between.normalized()), along, Vec2(-along.y(), along.x())}) {
    if (axis.dot(between) < 0) axis = -axis;
    gap = std::max(gap, between.dot(axis) - a.Reach(axis) - b.Reach(-axis));
  }
  return gap;
}

// Gaps and occlusion between neighbors on the grid.
void CompareNeighbors(const LinkModel& model, const Projector& camera, const SkinGeometry& geometry,
                      const std::vector<std::optional<Outline>>& outlines, std::vector<MarkerView>& views) {
  const Vec3& eye = camera.center_in_link();
  const int paths = model.markers.paths, rings = model.markers.rings();
  for (int m = 0; m < geometry.markers(); ++m) {
    const auto i = static_cast<size_t>(m);
    if (!outlines[i] || !views[i].is_seen()) continue;
    for (const auto& [path_step, ring_step] : {std::pair(1, 0), {0, 1}, {1, 1}, {-1, 1}}) {
      const int ring = model.RingOf(m) + ring_step;
      if (ring >= rings) continue;
      const int other = model.MarkerIndex((model.PathOf(m) + path_step + paths) % paths, ring);
      const auto j = static_cast<size_t>(other);
      if (!outlines[j] || (views[j].sight != Sight::kSeen && views[j].sight != Sight::kBehindMarker))
        continue;
      const double gap = GapPx(*outlines[i], *outlines[j], camera.model().lens.principal_point_px);
      for (const auto& [one, two] : {std::pair(m, other), {other, m}}) {
        MarkerView& view = views[static_cast<size_t>(one)];
        if (gap < view.gap_px) {
          view.gap_px = gap;
          view.neighbor = two;
        }
      }
      const size_t far = (geometry.feet[i] - eye).norm() > (geometry.feet[j] - eye).norm() ? i : j;
      const size_t near = far == i ? j : i;
      const Vec2 between = outlines[far]->center - outlines[near]->center;
      if (gap < 0 && outlines[near]->Reach(between.normalized()) > between.norm())
        views[far].sight = Sight::kBehindMarker;
    }
  }
}

bool SeesWall(const Projector& camera, const SkinGeometry& geometry, double z_mm, double angle_rad) {
  const double radius = geometry.WallRadius(z_mm, angle_rad);
  const Vec3 point(radius * std::cos(angle_rad), radius * std::sin(angle_rad), z_mm);
  const auto pixel = camera.Project(point);
  const CameraModel& model = camera.model();
  return pixel && pixel->x() >= -0.5 && pixel->y() >= -0.5 && pixel->x() <= model.width_px - 0.5 &&
         pixel->y() <= model.height_px - 0.5 &&
         ClearanceMm(geometry, point, camera.center_in_link()) >= -kGrazingMm &&
         !IsBehindTube(geometry, point, camera.center_in_link());
}

// Length from either end to the first row that is seen at all angles.
template <typename Sees>
BlindZone BlindOf(double length_mm, Sees sees) {
  const auto from_end = [&](bool top) {
    for (int i = 0; i < kBlindSamples; ++i) {
      const double off = length_mm * (i + 0.5) / kBlindSamples;
      if (sees(top ? off : length_mm - off)) return length_mm * i / kBlindSamples;
    }
    return length_mm;
  };
  return {from_end(true), from_end(false)};
}

template <typename Sees>
bool OnAllSides(Sees sees) {
  for (int i = 0; i < kBlindAngles; ++i) {
    if (!sees(2 * kPi * i / kBlindAngles)) return false;
  }
  return true;
}

}  // namespace

const char* Name(Sight sight) {
  switch (sight) {
    case Sight::kSeen:
      return "seen";
    case Sight::kTurnedAway:
      return "turned away";
    case Sight::kOutsideLens:
      return "outside the lens";
    case Sight::kOutsideImage:
      return "outside the image";
    case Sight::kBehindWall:
      return "behind the wall";
    case Sight::kBehindTube:
      return "behind the tube's block";
    case Sight::kBehindMarker:
      return "behind another marker";
  }
  return "";
}

std::vector<MarkerView> ViewsOf(const LinkModel& model, const SkinGeometry& geometry,
                                const CameraModel& camera) {
  const Projector projector(camera);
  std::vector<MarkerView> views;
  std::vector<std::optional<Outline>> outlines(geometry.feet.size());
  for (int m = 0; m < geometry.markers(); ++m)
    views.push_back(ViewOf(projector, geometry, m, outlines[static_cast<size_t>(m)]));
  CompareNeighbors(model, projector, geometry, outlines, views);
  return views;
}

SkinVisibility FindVisibility(const LinkModel& model, const SkinGeometry& geometry) {
  SkinVisibility visibility;
  std::vector<Projector> projectors;
  for (const CameraId id : kBothCameras) {
    const Projector& camera = projectors.emplace_back(model.nominal_rig[id]);
    visibility.cameras[Index(id)] = ViewsOf(model, geometry, model.nominal_rig[id]);
    visibility.blind[Index(id)] = BlindOf(geometry.length_mm, [&](double z_mm) {
      return OnAllSides([&](double angle) { return SeesWall(camera, geometry, z_mm, angle); });
    });
  }
  visibility.blind_to_both = BlindOf(geometry.length_mm, [&](double z_mm) {
    return OnAllSides([&](double angle) {
      return std::ranges::any_of(
          projectors, [&](const Projector& camera) { return SeesWall(camera, geometry, z_mm, angle); });
    });
  });
  return visibility;
}

}  // namespace taclink
