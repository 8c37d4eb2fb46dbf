#include "bench/vision/vision_score.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace taclink {
namespace {

// A label belongs to a marker whose centre is within so much of it: the outline's centroid and the
// brightness' differ, and a neighbour or the picture's edge may cover a part.
constexpr double kBelongsPx = 1.2, kBelongsRadii = 0.5, kBelongsRadiiClipped = 1;
constexpr size_t kMaxNotes = 12;
constexpr double kTrimmed = 0.01;

double LongerHalfAxis(const Eigen::Matrix<double, 2, 3>& jacobian, double radius_mm) {
  const Mat2 squares = jacobian * jacobian.transpose();
  const double half_trace = squares.trace() / 2;
  const double root = std::sqrt(std::max(0.0, half_trace * half_trace - squares.determinant()));
  return radius_mm * std::sqrt(half_trace + root);
}

bool Belongs(const TrueSight& sight, double distance_px) {
  const double radii = sight.whole ? kBelongsRadii : kBelongsRadiiClipped;
  return distance_px <= kBelongsPx + radii * sight.radius_px;
}

template <typename T>
void Append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void MakeVisionTruth(const LinkModel& model, const StereoRig& rig, const Renderer& renderer,
                     const SkinTruth& skin, VisionTruth& truth) {
  const auto count = static_cast<size_t>(model.markers.count());
  truth.frame = skin.frame;
  truth.positions_mm = skin.marker_mm;
  truth.displacements_mm.resize(count);
  for (size_t m = 0; m < count; ++m)
    truth.displacements_mm[m] = skin.marker_mm[m] - model.RestMarker(static_cast<int>(m));
  for (const CameraId id : kBothCameras) {
    const Projector projector(rig[id]);
    auto& sights = truth.sights[Index(id)];
    sights.assign(count, {});
    for (size_t m = 0; m < count; ++m) {
      TrueSight& sight = sights[m];
      if (!renderer.Sees(skin, id, static_cast<int>(m))) continue;
      const auto center = renderer.Centroid(skin, id, static_cast<int>(m));
      const auto projected = projector.ProjectWithJacobian(skin.marker_wall_mm[m]);
      if (!center || !projected) continue;
      sight.center_px = *center;
      sight.radius_px = LongerHalfAxis(projected->jacobian, model.markers.diameter_mm / 2);
      const Vec2 size(rig[id].width_px - 1, rig[id].height_px - 1);
      const auto inside = [&](double border) {
        return (center->array() >= border).all() && (center->array() <= size.array() - border).all();
      };
      sight.drawn = inside(-sight.radius_px);
      sight.whole = inside(sight.radius_px + 1);
    }
  }
}

void ErrorSums::Add(const Vec3& error_mm, const Vec3& at_mm) {
  const Vec2 out = at_mm.head<2>().normalized();
  const std::array<double, kErrorAxes> parts = {out.dot(error_mm.head<2>()),
                                                out.x() * error_mm.y() - out.y() * error_mm.x(), error_mm.z(),
                                                error_mm.norm()};
  ++count;
  for (size_t i = 0; i < kErrorAxes; ++i) {
    squares[i] += parts[i] * parts[i];
    worst[i] = std::max(worst[i], std::abs(parts[i]));
  }
}

void ErrorSums::Add(const ErrorSums& other) {
  count += other.count;
  for (size_t i = 0; i < kErrorAxes; ++i) {
    squares[i] += other.squares[i];
    worst[i] = std::max(worst[i], other.worst[i]);
  }
}

double ErrorSums::Rms(ErrorAxis axis) const {
  return count == 0 ? 0 : std::sqrt(squares[static_cast<size_t>(axis)] / static_cast<double>(count));
}

void LabelCounts::Add(const LabelCounts& other) {
  visible += other.visible;
  labelled += other.labelled;
  wrong += other.wrong;
  stray += other.stray;
  missing += other.missing;
}

void StageSamples::Add(const StageTimes& t) {
  const double seen = t.detect + t.register_ + t.reconstruct;
  decode.push_back(static_cast<float>(t.decode));
  detect.push_back(static_cast<float>(t.detect));
  label.push_back(static_cast<float>(t.register_));
  shape.push_back(static_cast<float>(t.reconstruct));
  vision.push_back(static_cast<float>(seen));
  whole.push_back(static_cast<float>(t.decode + seen + t.force));
}

void StageSamples::Add(const StageSamples& other) {
  Append(decode, other.decode);
  Append(detect, other.detect);
  Append(label, other.label);
  Append(shape, other.shape);
  Append(vision, other.vision);
  Append(whole, other.whole);
}

void VisionScore::Add(const VisionScore& other) {
  frames += other.frames;
  measured += other.measured;
  for (size_t i = 0; i < kStatusCount; ++i) statuses[i] += other.statuses[i];
  for (size_t i = 0; i < position.size(); ++i) {
    position[i].Add(other.position[i]);
    displacement[i].Add(other.displacement[i]);
  }
  for (size_t c = 0; c < kCameraCount; ++c) labels[c].Add(other.labels[c]);
  for (size_t s = 0; s < kSourceCount; ++s) Append(nees[s], other.nees[s]);
  systematic += other.systematic;
  random += other.random;
  split_count += other.split_count;
  times.Add(other.times);
}

VisionScorer::VisionScorer(const LinkModel& model)
    : model_(model), sums_(static_cast<size_t>(model.markers.count())) {}

void VisionScorer::Add(const VisionTruth& truth, const VisionResult& result) {
  ++score_.frames;
  ++score_.statuses[static_cast<size_t>(result.status)];
  if (result.shape.positions_mm.empty()) return;
  ++score_.measured;
  score_.times.Add(result.stage_ms);
  for (const CameraId id : kBothCameras) AddLabels(truth, result, id);
  AddShape(truth, result.shape);
}

void VisionScorer::AddLabels(const VisionTruth& truth, const VisionResult& result, CameraId id) {
  LabelCounts& counts = score_.labels[Index(id)];
  const auto& sights = truth.sights[Index(id)];
  const auto& labels = result.labels.cameras[Index(id)];
  for (size_t m = 0; m < sights.size(); ++m) {
    const bool labelled = m < labels.size() && labels[m].seen;
    counts.visible += sights[m].whole ? 1 : 0;
    counts.missing += sights[m].whole && !labelled ? 1 : 0;
    if (!labelled) continue;
    ++counts.labelled;
    size_t nearest = sights.size();
    double least = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < sights.size(); ++k) {
      const double distance = (sights[k].center_px - labels[m].center_px).norm();
      if (!sights[k].drawn || distance >= least) continue;
      least = distance;
      nearest = k;
    }
    const bool on_marker = nearest < sights.size() && Belongs(sights[nearest], least);
    if (on_marker && nearest == m) continue;
    ++(on_marker ? counts.wrong : counts.stray);
    Note(truth, id, m, on_marker ? static_cast<int>(nearest) : -1);
  }
}

std::string VisionScorer::MarkerName(size_t marker) const {
  const int m = static_cast<int>(marker);
  return "(" + std::to_string(model_.PathOf(m) + 1) + ", " + std::to_string(model_.RingOf(m) + 1) + ")";
}

void VisionScorer::Note(const VisionTruth& truth, CameraId id, size_t marker, int really) {
  if (incidents_.labels.size() >= kMaxNotes) return;
  incidents_.labels.push_back("frame " + std::to_string(truth.frame) + ", " + Name(id) + ": " +
                              MarkerName(marker) + " is on " +
                              (really < 0 ? "no marker" : MarkerName(static_cast<size_t>(really))));
}

void VisionScorer::AddShape(const VisionTruth& truth, const SkinShape& shape) {
  for (size_t m = 0; m < truth.positions_mm.size(); ++m) {
    const Vec3 error = shape.positions_mm[m] - truth.positions_mm[m];
    const Vec3 moved = shape.displacements_mm[m] - truth.displacements_mm[m];
    const auto cameras = static_cast<size_t>(truth.WholeIn(m));
    score_.position[cameras].Add(error, truth.positions_mm[m]);
    score_.displacement[cameras].Add(moved, truth.positions_mm[m]);
    if (cameras == 2) {
      sums_[m].count += 1;
      sums_[m].sum += error;
      sums_[m].squares += error.squaredNorm();
      if (error.norm() > incidents_.worst_mm) {
        incidents_.worst_mm = error.norm();
        incidents_.worst_frame = truth.frame;
        incidents_.worst_marker = static_cast<int>(m);
      }
    }
    if (m >= shape.covariances_mm2.size()) continue;
    const Eigen::LDLT<Mat3> factor(shape.covariances_mm2[m]);
    const double normalised = moved.dot(factor.solve(moved)) / 3;
    score_.nees[static_cast<size_t>(shape.sources[m])].push_back(static_cast<float>(normalised));
  }
}

void VisionScorer::Finish() {
  for (const MarkerSum& s : sums_) {
    if (s.count < 2) continue;
    const double of_mean = s.sum.squaredNorm() / s.count, variance = (s.squares - of_mean) / (s.count - 1);
    score_.systematic += of_mean - variance;  // the mean scatters too
    score_.random += s.count * variance;
    score_.split_count += s.count;
  }
}

double Percentile(std::vector<float> samples, double share) {
  if (samples.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(samples.size() - 1) + 0.5);
  std::nth_element(samples.begin(), samples.begin() + at, samples.end());
  return static_cast<double>(samples[static_cast<size_t>(at)]);
}

Consistency ConsistencyOf(std::vector<float> nees) {
  Consistency result;
  result.count = static_cast<int64_t>(nees.size());
  if (nees.empty()) return result;
  std::sort(nees.begin(), nees.end());
  const auto kept = nees.size() - static_cast<size_t>(kTrimmed * static_cast<double>(nees.size()));
  const auto mean = [&](size_t count) {
    return std::accumulate(nees.begin(), nees.begin() + static_cast<std::ptrdiff_t>(count), 0.0) /
           static_cast<double>(count);
  };
  result.mean = mean(nees.size());
  result.trimmed = mean(kept);
  result.median = static_cast<double>(nees[nees.size() / 2]);
  return result;
}

}  // namespace taclink
