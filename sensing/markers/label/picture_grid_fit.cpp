#include "sensing/markers/label/picture_grid_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr double kSearchHalfWidth = 64, kSearchStep = 4;  // px around the nominal principal point
constexpr double kMinCoherence = 0.55;                    // of the path angles; 1: all on lines, 0: none
constexpr double kSector = 0.35;                          // path pitches off a line
constexpr double kMinSeen = 0.5;                          // of all markers
// Log radii against the nominal lens: shift, stretch, and bend at the outermost rings.
constexpr double kMaxShift = 0.42, kMaxStretch = 0.3, kMaxCurve = 0.16;
constexpr double kMinScore = 0.35;
constexpr double kCrowd = 0.6;       // part of the paths that makes a ring
constexpr double kBendPrior = 0.05;  // standard deviation of a harmonic's coefficient
constexpr int kMaxPaths = 64;

}  // namespace

GridFitter::GridFitter(const LinkModel& model, CameraId id, const Detections& detections)
    : model_(model), camera_(model.nominal_rig[id]), id_(id), detections_(detections), grid_(model, id) {}

Error GridFitter::Refusal(const std::string& why) const {
  return {ErrorCode::kInvalidArgument,
          "the " + std::string(Name(id_)) + " camera's picture can't be labelled: " + why +
              "; check the light, the link model and that little touches the skin"};
}

Result<PictureGrid> GridFitter::Run() {
  if (static_cast<double>(detections_.size()) < kMinSeen * model_.markers.count())
    return Refusal("only " + std::to_string(detections_.size()) + " spots found");
  const double coherence = FindCenter(model_.markers.paths, grid_.center_, grid_.roll_);
  if (coherence < kMinCoherence) return WrongPaths();
  RefineStar();
  PlaceSpots();
  if (auto fitted = FindRings(); !fitted) return fitted.error();
  for (int round = 0; round < 4; ++round) {
    Bend();
    PlaceSpots();
    if (round == 1) {  // straightened, the spots show the rings better
      if (auto fitted = FindRings(); !fitted) return fitted.error();
    }
    CenterRings();
  }
  if (auto checked = CheckRings(); !checked) return checked.error();
  MeasureLens();
  return grid_;
}

// Mean of exp(i n (angle - angle of path 0)) over all detections: of modulus 1 when all lie on paths.
std::complex<double> GridFitter::Coherence(int paths, const Vec2& center) const {
  std::complex<double> sum = 0;
  int count = 0;
  for (const Detection& d : detections_) {
    if (d.clipped) continue;
    const Vec2 at = d.center_px - center;
    sum += std::polar(1.0, paths * (std::atan2(at.y(), at.x()) - grid_.picture_angles_[0]));
    ++count;
  }
  return sum / static_cast<double>(std::max(1, count));
}

double GridFitter::FindCenter(int paths, Vec2& center, double& roll) const {
  double best = -1;
  const auto search = [&](const Vec2& start, double half_width, double step) {
    for (double y = -half_width; y <= half_width; y += step) {
      for (double x = -half_width; x <= half_width; x += step) {
        const Vec2 at = start + Vec2(x, y);
        const auto coherence = Coherence(paths, at);
        if (std::abs(coherence) <= best) continue;
        best = std::abs(coherence);
        center = at;
        roll = std::arg(coherence) / paths;
      }
    }
  };
  search(camera_.lens.principal_point_px, kSearchHalfWidth, kSearchStep);
  search(Vec2(center), kSearchStep - 1, 1);
  return best;
}

// The number of paths that would fit, if one does.
Error GridFitter::WrongPaths() const {
  std::vector<double> fits(kMaxPaths + 1, 0);
  Vec2 center;
  double roll = 0;
  for (int n = 4; n <= kMaxPaths; ++n) fits[static_cast<size_t>(n)] = FindCenter(n, center, roll);
  const double best = *std::max_element(fits.begin(), fits.end());
  const auto first =
      std::find_if(fits.begin(), fits.end(), [&](double fit) { return fit > 0 && fit >= 0.9 * best; });
  if (best < 0.75) return Refusal("the spots do not lie on paths through one point");
  return Refusal("the spots lie on " + std::to_string(first - fits.begin()) + " paths, the model has " +
                 std::to_string(model_.markers.paths));
}

// Least squares for centre and roll: a spot's distance across its line is n . (p - center) - r roll.
void GridFitter::RefineStar() {
  for (int iteration = 0; iteration < 8; ++iteration) {
    Mat3 normal = Mat3::Zero();
    Vec3 right = Vec3::Zero();
    for (const Detection& d : detections_) {
      const Vec2 at = d.center_px - grid_.center_;
      const double r = at.norm(), angle = std::atan2(at.y(), at.x());
      // The nearest line.
      const double turn = std::remainder(angle - grid_.PathAngle(0), grid_.path_pitch_);
      if (d.clipped || std::abs(turn) > kSector * grid_.path_pitch_ || r < 1) continue;
      const double line = angle - turn;
      const Vec3 row(-std::sin(line), std::cos(line), r);
      normal += row * row.transpose();
      right += row * (r * std::sin(turn));
    }
    const Vec3 step = normal.ldlt().solve(right);
    if (!step.allFinite()) return;
    grid_.center_ += step.head<2>();
    grid_.roll_ += step.z();
  }
}

void GridFitter::PlaceSpots() {
  if (grid_.ring_log_radii_.empty()) grid_.ring_log_radii_ = {1, 0};  // no harmonics yet: any
  spots_.clear();
  for (const Detection& d : detections_) {
    const auto place = grid_.PlaceOf(d.center_px);
    if (std::abs(place.off_path) > kSector || d.clipped) continue;
    spots_.push_back({d.center_px, place.path, place.off_path, place.log_radius});
  }
}

// From the camera's end.
bool GridFitter::NominalLogRadii() {
  const Projector projector(camera_);
  for (int i = 0; i < model_.markers.rings(); ++i) {
    const int ring = id_ == CameraId::kTop ? i : model_.markers.rings() - 1 - i;
    const auto pixel = projector.Project(model_.RestMarker(model_.MarkerIndex(0, ring)));
    if (!pixel) return false;
    nominal_.push_back(std::log((*pixel - camera_.lens.principal_point_px).norm()));
  }
  return true;
}

// All rings together: the nominal log radii, shifted (scale), stretched and curved (lens) so that most spots
// lie on one and few places stay empty; then every ring's own median. No path needs to be complete for that.
Result<void> GridFitter::FindRings() {
  SumSpots();
  if (nominal_.empty() && !NominalLogRadii())
    return Refusal("the model's nominal lens does not see all rings");
  const double outer = nominal_.front(), inner = nominal_.back();
  const double middle = 0.5 * (outer + inner), half = 0.5 * (outer - inner);
  double best = 0;
  std::vector<double> radii(nominal_.size());
  for (double curve = -kMaxCurve; curve <= kMaxCurve + 1e-9; curve += 0.04) {
    for (double stretch = -kMaxStretch; stretch <= kMaxStretch + 1e-9; stretch += 0.03) {
      for (double shift = -kMaxShift; shift <= kMaxShift + 1e-9; shift += 0.015) {
        for (size_t i = 0; i < radii.size(); ++i) {
          const double t = (nominal_[i] - middle) / half;
          radii[i] = middle + shift + (1 + stretch) * half * t + curve * (t * t - 0.5);
        }
        // The nominal lens counts a little, where two fit alike.
        const double score =
            Score(radii) * (1 - 0.2 * (std::abs(shift) + std::abs(stretch) + std::abs(curve)));
        if (score > best) best = score, grid_.ring_log_radii_ = radii;
      }
    }
  }
  if (best < kMinScore) return Refusal("the rings' distances do not fit the model");
  for (int round = 0; round < 3; ++round) CenterRings();
  return {};
}

// Part of the circle that is in the picture.
double GridFitter::PartOfRingInside(double log_radius) const {
  const double r = std::exp(log_radius);
  int inside = 0;
  for (int l = 0; l < model_.markers.paths; ++l) {
    const double angle = grid_.PathAngle(l);
    const Vec2 p = grid_.center_ + r * Vec2(std::cos(angle), std::sin(angle));
    const double margin = 0.05 * r;
    inside += p.x() > margin && p.y() > margin && p.x() < camera_.width_px - margin &&
                      p.y() < camera_.height_px - margin
                  ? 1
                  : 0;
  }
  return static_cast<double>(inside) / model_.markers.paths;
}

// So that Score costs the same for any number of spots.
void GridFitter::SumSpots() {
  sorted_.clear();
  for (const Spot& spot : spots_) sorted_.push_back(spot.log_radius);
  std::sort(sorted_.begin(), sorted_.end());
  sums_.assign(1, {0, 0});
  for (const double x : sorted_) sums_.push_back({sums_.back()[0] + x, sums_.back()[1] + x * x});
}

// Spots on rings, the nearer the better, of all spots and of all places that the picture should show.
double GridFitter::Score(const std::vector<double>& radii) const {
  double sum = 0, empty = 0;
  for (size_t i = 0; i < radii.size(); ++i) {
    const double c = radii[i];
    const double before = i > 0 ? radii[i - 1] - c : 1, after = i + 1 < radii.size() ? c - radii[i + 1] : 1;
    const double width = 0.3 * std::min(before, after);
    if (width < 0.002) return 0;
    const auto first =
        static_cast<size_t>(std::lower_bound(sorted_.begin(), sorted_.end(), c - width) - sorted_.begin());
    const auto last =
        static_cast<size_t>(std::upper_bound(sorted_.begin(), sorted_.end(), c + width) - sorted_.begin());
    const double n = static_cast<double>(last) - static_cast<double>(first);
    const double s1 = sums_[last][0] - sums_[first][0], s2 = sums_[last][1] - sums_[first][1];
    sum += n - (s2 - 2 * c * s1 + c * c * n) / (width * width);
    empty += std::max(0.0, model_.markers.paths * PartOfRingInside(c) - n);
  }
  return sum / std::max(1.0, static_cast<double>(sorted_.size()) + empty);
}

void GridFitter::CenterRings() {
  std::vector<double>& radii = grid_.ring_log_radii_;
  std::vector<std::vector<double>> on_ring(radii.size());
  for (const Spot& spot : spots_) {
    const RingPlace place = PlaceAmong(radii, spot.log_radius);
    if (place.off < 0.4 * place.spacing) on_ring[place.ring].push_back(spot.log_radius);
  }
  const std::vector<double> before = radii;
  std::vector<bool> known(radii.size(), false);
  for (size_t i = 0; i < on_ring.size(); ++i) {
    if (on_ring[i].size() < 3) continue;
    const auto middle = on_ring[i].begin() + static_cast<long>(on_ring[i].size() / 2);
    std::nth_element(on_ring[i].begin(), middle, on_ring[i].end());
    radii[i] = *middle;
    known[i] = true;
  }
  // A ring without spots moves with the next one that has some.
  for (size_t i = 0; i < radii.size(); ++i) {
    if (known[i]) continue;
    for (size_t step = 1; step < radii.size(); ++step) {
      const bool near = i >= step && known[i - step], far = i + step < radii.size() && known[i + step];
      if (!near && !far) continue;
      const size_t other = near ? i - step : i + step;
      radii[i] = before[i] + radii[other] - before[other];
      break;
    }
  }
}

// Robust least squares for the harmonics, over the spots on rings.
void GridFitter::Bend() {
  using Normal = Eigen::Matrix<double, 6, 6>;
  const double scale = 0.02;  // where a residual begins to count less; rad and log radius
  for (int iteration = 0; iteration < 3; ++iteration) {
    Normal angle_normal = Normal::Identity() * (scale / kBendPrior) * (scale / kBendPrior);
    Normal radius_normal = angle_normal;
    PictureGrid::Harmonics angle_right = PictureGrid::Harmonics::Zero(), radius_right = angle_right;
    for (const Spot& spot : spots_) {
      const Vec2 at = spot.pixel - grid_.center_;
      const double angle = std::atan2(at.y(), at.x()), log_radius = std::log(at.norm());
      const auto h = grid_.HarmonicsAt(angle, log_radius);
      const RingPlace ring = PlaceAmong(grid_.ring_log_radii_, spot.log_radius);
      if (ring.off > 0.4 * ring.spacing) continue;
      const double off_angle = std::remainder(angle - grid_.PathAngle(spot.path), 2 * kPi);
      const double off_radius = log_radius - grid_.ring_log_radii_[ring.ring];
      const auto add = [&](double off, const PictureGrid::Harmonics& terms, Normal& normal, auto& right) {
        const double residual = (off - terms.dot(h)) / scale;
        const double weight = 1 / (1 + residual * residual);
        normal += weight * h * h.transpose();
        right += weight * off * h;
      };
      add(off_angle, grid_.angle_terms_, angle_normal, angle_right);
      add(off_radius, grid_.radius_terms_, radius_normal, radius_right);
    }
    grid_.angle_terms_ = angle_normal.ldlt().solve(angle_right);
    grid_.radius_terms_ = radius_normal.ldlt().solve(radius_right);
  }
}

// Spots of many paths at one distance where the model has no ring: it is another model.
Result<void> GridFitter::CheckRings() const {
  std::vector<double> between;
  for (const Spot& spot : spots_) {
    const RingPlace place = PlaceAmong(grid_.ring_log_radii_, spot.log_radius);
    if (place.off > 0.3 * place.spacing) between.push_back(spot.log_radius);
  }
  std::sort(between.begin(), between.end());
  const auto crowd = static_cast<size_t>(std::ceil(kCrowd * model_.markers.paths));
  for (size_t i = 0; i + crowd <= between.size(); ++i) {
    const RingPlace place = PlaceAmong(grid_.ring_log_radii_, between[i]);
    if (between[i + crowd - 1] - between[i] < 0.2 * place.spacing)
      return Refusal("there is a ring of spots " +
                     std::to_string(static_cast<int>(std::exp(between[i + crowd / 2]))) +
                     " px from the centre where the model has none: it has another number of rings or "
                     "other distances between them");
  }
  std::vector<int> on_path(static_cast<size_t>(model_.markers.paths), 0);
  for (const Spot& spot : spots_) ++on_path[static_cast<size_t>(spot.path)];
  const auto empty =
      std::count_if(on_path.begin(), on_path.end(), [&](int n) { return n < 0.2 * model_.markers.rings(); });
  if (static_cast<double>(empty) > 0.25 * model_.markers.paths)
    return Refusal(std::to_string(empty) + " of the model's " + std::to_string(model_.markers.paths) +
                   " paths show hardly a spot");
  return {};
}

void GridFitter::MeasureLens() {
  const auto& radii = grid_.ring_log_radii_;
  double mean = 0, sum = 0;
  for (size_t i = 0; i < radii.size(); ++i)
    mean += (radii[i] - nominal_[i]) / static_cast<double>(radii.size());
  for (size_t i = 0; i < radii.size(); ++i) sum += std::pow(radii[i] - nominal_[i] - mean, 2);
  grid_.lens_misfit_ = std::sqrt(sum / static_cast<double>(radii.size()));
}

// `radii` fall; the ring nearest to a spot.
GridFitter::RingPlace GridFitter::PlaceAmong(const std::vector<double>& radii, double log_radius) {
  const auto after = std::lower_bound(radii.begin(), radii.end(), log_radius, std::greater<>());
  auto best = static_cast<size_t>(after - radii.begin());
  if (best == radii.size() || (best > 0 && radii[best - 1] - log_radius < log_radius - radii[best])) --best;
  double spacing = std::numeric_limits<double>::infinity();
  if (best > 0) spacing = std::min(spacing, radii[best - 1] - radii[best]);
  if (best + 1 < radii.size()) spacing = std::min(spacing, radii[best] - radii[best + 1]);
  return {best, std::abs(radii[best] - log_radius), spacing};
}

}  // namespace taclink
