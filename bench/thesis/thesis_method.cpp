#include "bench/thesis/thesis_method.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "bench/thesis/thesis_camera.h"
#include "bench/thesis/thesis_detection.h"
#include "bench/tools/thread_clock.h"
#include "sensing/capture/decode.h"

namespace taclink {
namespace {

constexpr double kLambda = 0.5;
constexpr double kSearchAngle = RadFromDeg(30);  // alpha and beta
constexpr int kCalibrationFrames = 8;

// Whether the angle between two vectors is below the search angle.
bool Within(const Vec2& a, const Vec2& b) {
  static const double kLeastCosine = std::cos(kSearchAngle);
  return a.dot(b) > kLeastCosine * std::sqrt(a.squaredNorm() * b.squaredNorm());
}

// Where a path begins and ends in one picture, and the ring of its first node.
struct PathEnds {
  Vec2 start = Vec2::Zero(), end = Vec2::Zero();
  int first = 0;  // counted from the near end
  bool usable = false;
};

class ThesisMethod final : public VisionMethod {
 public:
  explicit ThesisMethod(const LinkModel& model) : model_(model), rest_mm_(model.RestMarkers()) { Restart(); }

  void Restart() override {
    taken_ = 0;
    calibrated_ = false;
    detection_.clear();
    baseline_mm_ = rest_mm_;
    for (const CameraId id : kBothCameras) {
      cameras_[Index(id)] = NominalThesisCamera(model_, id);
      detection_.emplace_back(model_, cameras_[Index(id)]);
      FindEnds(id);
      sums_.cameras[Index(id)].assign(rest_mm_.size(), {});
      counts_[Index(id)].assign(rest_mm_.size(), 0);
    }
  }

  void Process(const StereoFrame& frame, VisionResult& result) override {
    const Clock& clock = ThreadCpuClock();
    result.stage_ms = {};
    int64_t before = clock.MonotonicNs();
    const auto timed = [&](double& stage_ms) {
      const int64_t now = clock.MonotonicNs();
      stage_ms = static_cast<double>(now - before) * 1e-6;
      before = clock.MonotonicNs();
    };
    for (size_t i = 0; i < kCameraCount; ++i) {
      if (!frame.images[i].valid || !decoders_[i].Decode(frame.images[i], gray_[i]).ok()) gray_[i].release();
    }
    timed(result.stage_ms.decode);
    for (size_t i = 0; i < kCameraCount; ++i) {
      if (taken_ == 0 && !gray_[i].empty()) detection_[i].Tune(gray_[i]);
      detection_[i].Detect(gray_[i], found_[i]);
    }
    timed(result.stage_ms.detect);
    for (const CameraId id : kBothCameras) Trace(id, result.labels.cameras[Index(id)]);
    timed(result.stage_ms.register_);
    result.status = calibrated_ ? LinkStatus::kOk : LinkStatus::kCalibrating;
    result.status_reason.clear();
    if (calibrated_) {
      Reconstruct(result.labels, result.shape);
    } else {
      result.shape = {};
      TakeRest(result.labels);
    }
    timed(result.stage_ms.reconstruct);
  }

 private:
  int RingFrom(CameraId id, int step) const {  // step-th ring counted from the near end
    return id == CameraId::kTop ? step : model_.markers.rings() - 1 - step;
  }

  // (4.7) and (4.8), through the lens.
  void FindEnds(CameraId id) {
    const ThesisCamera& camera = cameras_[Index(id)];
    const CameraModel& nominal = model_.nominal_rig[id];
    const double near_z = id == CameraId::kTop ? 0 : model_.length_mm, depth = model_.markers.center_depth_mm;
    auto& paths = ends_[Index(id)];
    paths.assign(static_cast<size_t>(model_.markers.paths), {});
    for (int l = 0; l < model_.markers.paths; ++l) {
      PathEnds& path = paths[static_cast<size_t>(l)];
      const double angle = model_.PathAngle(l);
      auto start = camera.Project(model_.PointAtDepth(angle, near_z, depth));
      const auto end = camera.Project(model_.PointAtDepth(angle, model_.length_mm - near_z, depth));
      for (path.first = 0; path.first < model_.markers.rings(); ++path.first) {
        const Vec3 p = rest_mm_[static_cast<size_t>(model_.MarkerIndex(l, RingFrom(id, path.first)))];
        const auto pixel = camera.Project(p);
        const double size = camera.focal_px * model_.markers.diameter_mm / 2 / camera.Depth(p.z());
        if (pixel && pixel->x() > size && pixel->y() > size && pixel->x() < nominal.width_px - 1 - size &&
            pixel->y() < nominal.height_px - 1 - size)
          break;
        if (pixel) start = pixel;
      }
      path.usable = start && end;
      if (!path.usable) continue;
      path.start = *start;
      path.end = *end;
    }
  }

  // Algorithms 1 and 2.
  void Trace(CameraId id, std::vector<MarkerObservation>& labels) {
    labels.assign(rest_mm_.size(), {});
    std::vector<Vec2>& found = found_[Index(id)];
    for (int l = 0; l < model_.markers.paths; ++l) {
      const PathEnds& path = ends_[Index(id)][static_cast<size_t>(l)];
      if (!path.usable) continue;
      Vec2 node = path.start;
      for (int step = path.first; step < model_.markers.rings(); ++step) {
        const auto next = BestNode(found, node, path.end);
        if (next == found.size()) break;
        node = found[next];
        found.erase(found.begin() + static_cast<std::ptrdiff_t>(next));
        MarkerObservation& label = labels[static_cast<size_t>(model_.MarkerIndex(l, RingFrom(id, step)))];
        label.seen = true;
        label.center_px = node;
      }
    }
  }

  // (4.25) to (4.29); the size of `found` if there is no candidate.
  static size_t BestNode(const std::vector<Vec2>& found, const Vec2& node, const Vec2& end) {
    const Vec2 line = end - node;
    const double length = line.norm();
    double least = std::numeric_limits<double>::infinity();
    size_t best = found.size();
    for (size_t i = 0; i < found.size(); ++i) {
      const Vec2 step = found[i] - node;
      if (!Within(step, line) || !Within(found[i] - end, -line)) continue;
      const double smooth = std::abs(step.x() * line.y() - step.y() * line.x()) / length;
      const double cost = (1 - kLambda) * step.norm() + kLambda * smooth;
      if (cost >= least) continue;
      least = cost;
      best = i;
    }
    return best;
  }

  // Nearer to its own place at rest than to half the way to the neighbouring ring's?
  bool NearItsRing(CameraId id, size_t marker, const Vec2& pixel) const {
    const auto own = cameras_[Index(id)].Project(rest_mm_[marker]);
    if (!own) return false;
    const int ring = model_.RingOf(static_cast<int>(marker)), path = model_.PathOf(static_cast<int>(marker));
    for (const int other : {ring - 1, ring + 1}) {
      if (other < 0 || other >= model_.markers.rings()) continue;
      const auto there =
          cameras_[Index(id)].Project(rest_mm_[static_cast<size_t>(model_.MarkerIndex(path, other))]);
      if (there && (pixel - *there).norm() < (pixel - *own).norm()) return false;
    }
    return true;
  }

  void TakeRest(const LabelledMarkers& labels) {
    for (const CameraId id : kBothCameras) {
      for (size_t m = 0; m < rest_mm_.size(); ++m) {
        const MarkerObservation& label = labels.cameras[Index(id)][m];
        if (!label.seen || !NearItsRing(id, m, label.center_px)) continue;
        sums_.cameras[Index(id)][m].center_px += label.center_px;
        ++counts_[Index(id)][m];
      }
    }
    if (++taken_ < kCalibrationFrames) return;
    LabelledMarkers mean = sums_;
    for (const CameraId id : kBothCameras) {
      for (size_t m = 0; m < rest_mm_.size(); ++m) {
        const int count = counts_[Index(id)][m];
        mean.cameras[Index(id)][m].seen = 2 * count > kCalibrationFrames;
        if (count > 0) mean.cameras[Index(id)][m].center_px /= count;
      }
      const auto camera = CalibrateThesisCamera(model_, id, mean.cameras[Index(id)]);
      if (!camera) return Restart();
      cameras_[Index(id)] = *camera;
    }
    for (const CameraId id : kBothCameras) FindEnds(id);
    calibrated_ = true;
    SkinShape rest;
    Reconstruct(mean, rest);
    baseline_mm_ = rest.positions_mm;
  }

  void Reconstruct(const LabelledMarkers& labels, SkinShape& shape) const {
    shape.positions_mm = rest_mm_;
    shape.sources.assign(rest_mm_.size(), MarkerSource::kInferred);
    shape.displacements_mm.resize(rest_mm_.size());
    shape.covariances_mm2.clear();
    for (size_t m = 0; m < rest_mm_.size(); ++m) {
      const MarkerObservation &top = labels.cameras[0][m], &bottom = labels.cameras[1][m];
      if (top.seen && bottom.seen) {
        shape.positions_mm[m] = Triangulate(top.center_px, bottom.center_px);
        shape.sources[m] = MarkerSource::kBoth;
      } else if (top.seen || bottom.seen) {
        const size_t camera = top.seen ? 0 : 1;
        shape.positions_mm[m] =
            FromOne(cameras_[camera], labels.cameras[camera][m].center_px, rest_mm_[m].z());
        shape.sources[m] = top.seen ? MarkerSource::kTop : MarkerSource::kBottom;
      }
    }
    for (int l = 0; l < model_.markers.paths; ++l) Interpolate(l, shape);
    for (size_t m = 0; m < rest_mm_.size(); ++m)
      shape.displacements_mm[m] = shape.positions_mm[m] - baseline_mm_[m];
  }

  // (4.11) to (4.15).
  Vec3 Triangulate(const Vec2& top_px, const Vec2& bottom_px) const {
    const auto [r1, phi1] = cameras_[0].See(top_px);
    const auto [r2, phi2] = cameras_[1].See(bottom_px);
    const double f1 = cameras_[0].focal_px, f2 = cameras_[1].focal_px;
    const double b1 = cameras_[0].place_mm, b2 = cameras_[1].place_mm, both = f1 * r2 + f2 * r1;
    const double z = (f1 * b2 * r2 - f2 * b1 * r1) / both, radius = (b1 + b2) * r1 * r2 / both;
    double phi = (phi1 + phi2) / 2;
    if (std::abs(phi1 - phi2) > kPi) phi -= std::copysign(kPi, phi1 - phi2);
    return {radius * std::cos(phi), radius * std::sin(phi), z};
  }

  // (4.31) and (4.32).
  static Vec3 FromOne(const ThesisCamera& camera, const Vec2& pixel, double z_mm) {
    const auto [r, phi] = camera.See(pixel);
    const double radius = camera.Depth(z_mm) / camera.focal_px * r;
    return {radius * std::cos(phi), radius * std::sin(phi), z_mm};
  }

  // (4.33) and (4.34): by the count of rings, the clamped ends are known.
  void Interpolate(int path, SkinShape& shape) const {
    const int rings = model_.markers.rings();
    const double angle = model_.PathAngle(path), depth = model_.markers.center_depth_mm;
    int before = -1;
    Vec3 p_before = model_.PointAtDepth(angle, 0, depth);
    for (int j = 0; j <= rings; ++j) {
      const auto at = static_cast<size_t>(model_.MarkerIndex(path, std::min(j, rings - 1)));
      if (j < rings && shape.sources[at] == MarkerSource::kInferred) continue;
      const Vec3 p = j < rings ? shape.positions_mm[at] : model_.PointAtDepth(angle, model_.length_mm, depth);
      for (int between = before + 1; between < j; ++between) {
        const double weight = static_cast<double>(between - before) / (j - before);
        shape.positions_mm[static_cast<size_t>(model_.MarkerIndex(path, between))] =
            (1 - weight) * p_before + weight * p;
      }
      before = j;
      p_before = p;
    }
  }

  const LinkModel model_;
  const std::vector<Vec3> rest_mm_;
  std::array<ThesisCamera, kCameraCount> cameras_;
  std::vector<ThesisDetection> detection_;
  std::array<std::vector<PathEnds>, kCameraCount> ends_;
  std::array<GrayDecoder, kCameraCount> decoders_;
  std::array<cv::Mat, kCameraCount> gray_;
  std::array<std::vector<Vec2>, kCameraCount> found_;
  int taken_ = 0;
  bool calibrated_ = false;
  LabelledMarkers sums_;
  std::array<std::vector<int>, kCameraCount> counts_;
  std::vector<Vec3> baseline_mm_;
};

}  // namespace

std::unique_ptr<VisionMethod> MakeThesisMethod(const LinkModel& model) {
  return std::make_unique<ThesisMethod>(model);
}

}  // namespace taclink
