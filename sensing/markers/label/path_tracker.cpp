#include "sensing/markers/label/path_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

// How far beyond the far clamped end, on the way to the axis, a path's control line goes on: a dent near that
// end is seen inside it.
constexpr double kBeyondEnd = 0.35;
// A detection nearer to another path costs more.
constexpr double kForeign = 2;

// cos of the angle between two vectors is at least `least`, without the root of a division.
bool WithinAngle(const Vec2& a, const Vec2& b, double least) {
  return a.dot(b) >= least * std::sqrt(a.squaredNorm() * b.squaredNorm());
}

// What both displacements have in common.
double Least(double a, double b) {
  return a * b > 0 ? std::copysign(std::min(std::abs(a), std::abs(b)), a) : 0;
}

// Azimuth, link frame, at which a ray passes the cylinder of that radius about the link's axis.
std::optional<double> AzimuthAtRadius(const SightRay& ray, double radius_mm) {
  const Vec2 o = ray.origin.head<2>(), d = ray.direction.head<2>();
  const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - radius_mm * radius_mm;
  const double discriminant = b * b - a * c;
  if (a < 1e-12 || discriminant < 0) return std::nullopt;
  const Vec2 p = o + (-b + std::sqrt(discriminant)) / a * d;
  return std::atan2(p.y(), p.x());
}

}  // namespace

PathTracker::PathTracker(const SimilarSkin& skin, PathTrackerOptions options)
    : model_(skin.model), options_(options), numbering_(model_, options.numbering) {
  const auto paths = static_cast<size_t>(model_.markers.paths);
  for (const CameraId id : kBothCameras) {
    views_.push_back({Projector(skin.rig[id]), {}, {}, {}, {}});
    FindEnds(id, views_.back());
    FindAreas(views_.back());
    chains_[Index(id)].resize(paths);
    for (auto& chain : chains_[Index(id)]) chain.reserve(static_cast<size_t>(numbering_.max_chain()));
    path_rays_[Index(id)].reserve(static_cast<size_t>(numbering_.max_chain()));
  }
  by_path_.resize(paths);
  displacements_mm_.resize(static_cast<size_t>(model_.markers.count()));
  for (auto& places : places_) places.resize(displacements_mm_.size());
  numbered_.resize(paths);
  complete_.resize(paths);
  whole_ring_mm_.resize(static_cast<size_t>(model_.markers.rings()));
  around_mm_.resize(static_cast<size_t>(model_.markers.rings()));
  ring_mm_.reserve(paths);
  dropped_.reserve(displacements_mm_.size());
  tracings_.resize(paths);
  for (int j = 0; j < model_.markers.rings(); ++j) {
    mean_radius_mm_ += model_.RestMarker(model_.MarkerIndex(0, j)).head<2>().norm() / model_.markers.rings();
  }
}

void PathTracker::FindEnds(CameraId id, View& view) const {
  const MarkerGrid& grid = model_.markers;
  const double near_z = id == CameraId::kTop ? 0 : model_.length_mm;
  const double far_z = model_.length_mm - near_z;
  const auto axis = view.projector.Project(Vec3(0, 0, far_z));
  for (int l = 0; l < grid.paths; ++l) {
    const double angle = model_.PathAngle(l);
    const auto end = view.projector.Project(model_.PointAtDepth(angle, far_z, grid.center_depth_mm));
    const bool usable = axis && end;
    view.usable.push_back(usable);
    view.ends.push_back(usable ? Vec2(*end + kBeyondEnd * (*axis - *end)) : Vec2(Vec2::Zero()));
    // The near end may be beyond what the lens model sees: then from a ring that it sees, one step back.
    auto start = view.projector.Project(model_.PointAtDepth(angle, near_z, grid.center_depth_mm));
    for (int i = 0; usable && !start && i < grid.rings(); ++i) {
      const int ring = id == CameraId::kTop ? i : grid.rings() - 1 - i;
      const auto pixel = view.projector.Project(model_.RestMarker(model_.MarkerIndex(l, ring)));
      if (pixel) start = *pixel + 0.3 * (*pixel - *end);
    }
    view.starts.push_back(start.value_or(view.ends.back()));
  }
}

// A marker's area in the picture: its disc laid on the skin, or the dome seen from the side where that is
// more.
void PathTracker::FindAreas(View& view) const {
  const double disc = kPi / 4 * model_.markers.diameter_mm * model_.markers.diameter_mm;
  for (int j = 0; j < model_.markers.rings(); ++j) {
    const Vec3 p = model_.RestMarker(model_.MarkerIndex(0, j));
    const auto projected = view.projector.ProjectWithJacobian(p);
    if (!projected) continue;
    const Vec3 around = Vec3(-p.y(), p.x(), 0).normalized();
    const Vec2 across = projected->jacobian * around, along = projected->jacobian * Vec3::UnitZ();
    const double flat = std::abs(across.x() * along.y() - across.y() * along.x()) * disc;
    const double side = across.squaredNorm() * disc / 2;
    view.areas.push_back(
        {(projected->pixel - view.projector.model().lens.principal_point_px).norm(), std::max(flat, side)});
  }
  std::sort(view.areas.begin(), view.areas.end(),
            [](const auto& a, const auto& b) { return a.radius_px < b.radius_px; });
}

bool PathTracker::AreaFits(const View& view, const Detection& d) const {
  if (d.area_px2 <= 0 || d.clipped || view.areas.empty()) return true;
  const double radius = (d.center_px - view.projector.model().lens.principal_point_px).norm();
  const auto outer =
      std::find_if(view.areas.begin(), view.areas.end(), [&](const auto& a) { return a.radius_px > radius; });
  const double expected = (outer == view.areas.end() ? view.areas.back() : *outer).area_px2;
  return d.area_px2 > expected / options_.max_area_ratio && d.area_px2 < expected * options_.max_area_ratio;
}

void PathTracker::Label(const std::array<Detections, kCameraCount>& detections, LabelledMarkers& out) {
  for (const CameraId id : kBothCameras) {
    SortIntoPaths(id, detections[Index(id)]);
    Trace(id);
    out.cameras[Index(id)].assign(static_cast<size_t>(model_.markers.count()), MarkerObservation{});
  }
  const int paths = model_.markers.paths;
  for (int l = 0; l < paths; ++l) {
    auto& from_bottom = chains_[Index(CameraId::kBottom)][static_cast<size_t>(l)];
    std::reverse(from_bottom.begin(), from_bottom.end());  // rising z
    Number(l, {});
  }
  FindReferences();
  for (int l = 0; l < paths; ++l) {
    if (complete_[static_cast<size_t>(l)] == 0 && FindAround(l)) Number(l, around_mm_);
  }
  for (const CameraId id : kBothCameras) {
    for (int m = 0; m < model_.markers.count(); ++m) {
      const int place = places_[Index(id)][static_cast<size_t>(m)];
      if (place < 0) continue;
      const auto& chain = chains_[Index(id)][static_cast<size_t>(m % paths)];
      const Detection& d = detections[Index(id)][static_cast<size_t>(chain[static_cast<size_t>(place)])];
      out.cameras[Index(id)][static_cast<size_t>(m)] = {true, d.center_px, d.covariance_px2};
    }
  }
  DropImplausible(out);
}

std::span<const SightRay> PathTracker::RaysOf(CameraId id, int path) {
  auto& rays = path_rays_[Index(id)];
  rays.clear();
  for (const int detection : chains_[Index(id)][static_cast<size_t>(path)])
    rays.push_back(rays_[Index(id)][static_cast<size_t>(detection)]);
  return rays;
}

// What was numbered before stands if this numbers no more.
void PathTracker::Number(int path, std::span<const double> around_mm) {
  numbering_.Number(RaysOf(CameraId::kTop, path), RaysOf(CameraId::kBottom, path), around_mm);
  const auto l = static_cast<size_t>(path);
  int numbered = 0;
  for (const CameraId id : kBothCameras) {
    for (int j = 0; j < model_.markers.rings(); ++j) numbered += numbering_.LabelOf(id, j) >= 0 ? 1 : 0;
  }
  if (!around_mm.empty() && numbered <= numbered_[l]) return;
  numbered_[l] = numbered;
  for (int j = 0; j < model_.markers.rings(); ++j) {
    const auto marker = static_cast<size_t>(model_.MarkerIndex(path, j));
    displacements_mm_[marker] =
        numbering_.DisplacementOf(j).value_or(std::numeric_limits<double>::quiet_NaN());
    for (const CameraId id : kBothCameras) places_[Index(id)][marker] = numbering_.LabelOf(id, j);
  }
}

// What paths are numbered beside in the second pass, so that none depends on another's second answer: those
// of which all detections have a label, half of the rings in both cameras at least, and what rings do as a
// whole.
void PathTracker::FindReferences() {
  const int rings = model_.markers.rings();
  for (size_t l = 0; l < numbered_.size(); ++l) {
    const bool all = static_cast<size_t>(numbered_[l]) == chains_[0][l].size() + chains_[1][l].size();
    complete_[l] = all && numbered_[l] >= rings ? 1 : 0;
  }
  FindRings();
}

// Of each ring, the displacement (outwards) that three in four of its markers have at least.
void PathTracker::FindRings() {
  for (int j = 0; j < model_.markers.rings(); ++j) {
    ring_mm_.clear();
    for (int l = 0; l < model_.markers.paths; ++l) {
      const double mm = displacements_mm_[static_cast<size_t>(model_.MarkerIndex(l, j))];
      if (!std::isnan(mm)) ring_mm_.push_back(mm);
    }
    double& whole_mm = whole_ring_mm_[static_cast<size_t>(j)];
    whole_mm = 0;
    if (ring_mm_.empty()) continue;
    std::sort(ring_mm_.begin(), ring_mm_.end());
    const size_t quarter = ring_mm_.size() / 4;
    whole_mm = Least(ring_mm_[quarter], ring_mm_[ring_mm_.size() - 1 - quarter]);
  }
}

// On the line between the nearest complete paths on both sides, and along the skin between the rings that
// both show and its clamped ends. What is inwards counts as far as the whole ring is, for dents around tell
// nothing of this path; what is outwards is air's, which all feel. False: nothing complete is near, or it
// shows nothing.
bool PathTracker::FindAround(int path) {
  const int paths = model_.markers.paths, rings = model_.markers.rings();
  const auto nearest = [&](int step) {
    int away = 1;
    while (away < paths && complete_[static_cast<size_t>((path + step * away + paths) % paths)] == 0) ++away;
    return away;
  };
  const int before = nearest(-1), after = nearest(1);
  if (before + after > paths / 2) return false;
  const double share = static_cast<double>(before) / (before + after);
  const std::vector<double>& z_mm = model_.markers.rings_z_mm;
  size_t next = 0;
  double from_z_mm = 0, from_mm = 0, furthest_mm = 0;
  const auto fill = [&](size_t end, double to_z_mm, double to_mm) {
    for (; next < end; ++next)
      around_mm_[next] = from_mm + (to_mm - from_mm) * (z_mm[next] - from_z_mm) / (to_z_mm - from_z_mm);
    from_z_mm = to_z_mm;
    from_mm = to_mm;
    furthest_mm = std::max(furthest_mm, std::abs(to_mm));
  };
  for (int j = 0; j < rings; ++j) {
    const auto at = [&](int l) {
      return displacements_mm_[static_cast<size_t>(model_.MarkerIndex((l + paths) % paths, j))];
    };
    const double beside_mm = (1 - share) * at(path - before) + share * at(path + after);
    const auto k = static_cast<size_t>(j);
    if (!std::isnan(beside_mm))
      fill(k + 1, z_mm[k], beside_mm > 0 ? beside_mm : Least(beside_mm, whole_ring_mm_[k]));
  }
  fill(static_cast<size_t>(rings), model_.length_mm, 0);
  return furthest_mm > options_.least_around_mm;
}

void PathTracker::DropImplausible(LabelledMarkers& out) {
  const int paths = model_.markers.paths;
  const auto inward = [&](int path, int ring) {
    return -displacements_mm_[static_cast<size_t>(model_.MarkerIndex((path + paths) % paths, ring))];
  };
  dropped_.clear();
  FindRings();
  for (int j = 0; j < model_.markers.rings(); ++j) {
    // Dents are counted from rest also where a whole ring is pressed.
    const double ring = -std::max(0.0, whole_ring_mm_[static_cast<size_t>(j)]);
    for (int l = 0; l < paths; ++l) {
      const double u = inward(l, j), a = inward(l - 1, j), b = inward(l + 1, j);
      if (std::isnan(u) || std::isnan(a) || std::isnan(b)) continue;
      const auto is_in = [&](double from) {
        const double around = std::max({a - from, b - from, 0.0});
        return u - from > options_.max_beyond_mm + options_.max_beyond_times * around;
      };
      const bool beyond = u < std::min(a, b) - options_.max_beyond_mm;
      if (is_in(0) || is_in(ring) || beyond) dropped_.push_back(model_.MarkerIndex(l, j));
    }
  }
  for (const int marker : dropped_) {
    for (auto& camera : out.cameras) camera[static_cast<size_t>(marker)] = {};
  }
}

void PathTracker::SortIntoPaths(CameraId id, const Detections& detections) {
  const Projector& projector = views_[Index(id)].projector;
  candidates_.clear();
  rays_[Index(id)].clear();
  for (auto& list : by_path_) list.clear();
  const int paths = model_.markers.paths;
  for (const Detection& d : detections) {
    Candidate candidate{.pixel = d.center_px};
    const auto direction = projector.Ray(d.center_px);
    rays_[Index(id)].push_back({projector.center_in_link(), direction.value_or(Vec3::UnitZ())});
    const auto azimuth =
        direction ? AzimuthAtRadius(rays_[Index(id)].back(), mean_radius_mm_) : std::optional<double>();
    if (azimuth && AreaFits(views_[Index(id)], d)) {
      const double place = (*azimuth - model_.markers.first_path_angle_rad) / model_.markers.path_pitch_rad();
      const auto nearest = static_cast<int>(std::lround(place));
      candidate.path = (nearest % paths + paths) % paths;
      candidate.offset = place - nearest;
      by_path_[static_cast<size_t>(candidate.path)].push_back(static_cast<int>(candidates_.size()));
    }
    candidates_.push_back(candidate);
  }
}

// Round by round: every path proposes its best next node, the cheapest proposal for a detection wins.
void PathTracker::Trace(CameraId id) {
  const View& view = views_[Index(id)];
  auto& chains = chains_[Index(id)];
  size_t active = 0;
  for (size_t l = 0; l < tracings_.size(); ++l) {
    chains[l].clear();
    tracings_[l] = {.node = view.starts[l], .end = view.ends[l], .active = view.usable[l]};
    active += view.usable[l] ? 1 : 0;
  }
  owners_.resize(candidates_.size());
  while (active > 0) {
    std::fill(owners_.begin(), owners_.end(), -1);
    for (size_t l = 0; l < tracings_.size(); ++l) {
      Tracing& tracing = tracings_[l];
      if (!tracing.active) continue;
      FindBest(static_cast<int>(l), tracing);
      if (tracing.best < 0) {
        tracing.active = false;
        --active;
        continue;
      }
      int& owner = owners_[static_cast<size_t>(tracing.best)];
      if (owner < 0 || tracing.cost < tracings_[static_cast<size_t>(owner)].cost) owner = static_cast<int>(l);
    }
    for (size_t c = 0; c < owners_.size(); ++c) {
      if (owners_[c] < 0) continue;
      const auto l = static_cast<size_t>(owners_[c]);
      candidates_[c].taken = true;
      chains[l].push_back(static_cast<int>(c));
      tracings_[l].node = candidates_[c].pixel;
      if (static_cast<int>(chains[l].size()) == numbering_.max_chain()) {
        tracings_[l].active = false;
        --active;
      }
    }
  }
}

// (4.25) to (4.29).
void PathTracker::FindBest(int path, Tracing& tracing) const {
  tracing.best = -1;
  tracing.cost = std::numeric_limits<double>::infinity();
  const Vec2 line = tracing.end - tracing.node;
  const double length = line.norm();
  if (length < 1e-9) return;
  const double cos_alpha = std::cos(options_.alpha_rad), cos_beta = std::cos(options_.beta_rad);
  const int paths = model_.markers.paths;
  for (int neighbour = -1; neighbour <= 1; ++neighbour) {
    for (const int c : by_path_[static_cast<size_t>((path + neighbour + paths) % paths)]) {
      const Candidate& candidate = candidates_[static_cast<size_t>(c)];
      if (candidate.taken || std::abs(candidate.offset + neighbour) > options_.sector) continue;
      const Vec2 from_node = candidate.pixel - tracing.node, from_end = candidate.pixel - tracing.end;
      if (!WithinAngle(from_node, line, cos_alpha) || !WithinAngle(from_end, -line, cos_beta)) continue;
      const double closeness = from_node.norm();
      const double smoothness = std::abs(from_node.x() * line.y() - from_node.y() * line.x()) / length;
      const double cost = ((1 - options_.lambda) * closeness + options_.lambda * smoothness) *
                          (neighbour == 0 ? 1 : kForeign);
      if (cost < tracing.cost) {
        tracing.cost = cost;
        tracing.best = c;
      }
    }
  }
}

}  // namespace taclink
