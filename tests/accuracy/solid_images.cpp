#include "tests/accuracy/solid_images.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "sensing/core/clock.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/simulation/renderer.h"

namespace taclink {
namespace {

constexpr int kRestFrames = 4, kWayFrames = 5, kHeldFrames = 3;

// The skin between its markers is straight; its normals are those of their neighbors.
class SolidWriter {
 public:
  explicit SolidWriter(const LinkModel& model) : model_(model) {}

  void Write(const std::vector<Vec3>& displacements_mm, SkinTruth& truth) {
    const auto count = static_cast<size_t>(model_.markers.count());
    truth.marker_mm.resize(count);
    truth.marker_wall_mm.resize(count);
    truth.marker_normal.resize(count);
    for (int m = 0; m < model_.markers.count(); ++m)
      truth.marker_mm[static_cast<size_t>(m)] =
          model_.RestMarker(m) + displacements_mm[static_cast<size_t>(m)];
    const double dome_mm = model_.markers.center_depth_mm - model_.thickness_mm;
    for (int m = 0; m < model_.markers.count(); ++m) {
      const auto i = static_cast<size_t>(m);
      truth.marker_normal[i] = Normal(truth, m);
      truth.marker_wall_mm[i] = truth.marker_mm[i] + dome_mm * truth.marker_normal[i];
    }
    WriteWall(truth);
  }

 private:
  // Of a neighbor; beyond the first and the last ring, of the clamped end.
  Vec3 At(const SkinTruth& truth, int path, int ring) const {
    const int paths = model_.markers.paths, rings = model_.markers.rings();
    path = (path + paths) % paths;
    if (ring >= 0 && ring < rings)
      return truth.marker_mm[static_cast<size_t>(model_.MarkerIndex(path, ring))];
    const double angle = model_.markers.first_path_angle_rad + path * model_.markers.path_pitch_rad();
    return model_.PointAtDepth(angle, ring < 0 ? 0 : model_.length_mm, model_.markers.center_depth_mm);
  }
  Vec3 Normal(const SkinTruth& truth, int marker) const {
    const int path = model_.PathOf(marker), ring = model_.RingOf(marker);
    const Vec3 around = At(truth, path + 1, ring) - At(truth, path - 1, ring);
    const Vec3 along = At(truth, path, ring + 1) - At(truth, path, ring - 1);
    return around.cross(along).normalized();
  }
  void WriteWall(SkinTruth& truth) const {
    RadiusGrid& wall = truth.inner_wall;
    const int paths = model_.markers.paths, rows = model_.markers.rings() + 2;
    wall.columns = paths;
    wall.first_angle_rad = model_.markers.first_path_angle_rad;
    wall.z_mm.assign(1, 0);
    wall.z_mm.insert(wall.z_mm.end(), model_.markers.rings_z_mm.begin(), model_.markers.rings_z_mm.end());
    wall.z_mm.push_back(model_.length_mm);
    wall.radius_mm.assign(static_cast<size_t>(rows * paths), 0);
    wall.row_min_mm.assign(static_cast<size_t>(rows), 1e9);
    wall.largest_inward_change_mm = 0;
    for (int row = 0; row < rows; ++row) {
      const auto r = static_cast<size_t>(row);
      const double rest = model_.PointAtDepth(0, wall.z_mm[r], model_.thickness_mm).head<2>().norm();
      for (int path = 0; path < paths; ++path) {
        double& radius = wall.radius_mm[static_cast<size_t>(row * paths + path)];
        const bool clamped = row == 0 || row == rows - 1;
        const auto marker = clamped ? 0 : static_cast<size_t>(model_.MarkerIndex(path, row - 1));
        radius = clamped ? rest : truth.marker_wall_mm[marker].head<2>().norm();
        wall.row_min_mm[r] = std::min(wall.row_min_mm[r], radius);
        wall.largest_inward_change_mm = std::max(wall.largest_inward_change_mm, rest - radius);
      }
    }
  }

  const LinkModel& model_;
};

CameraEffects OtherCameras() {
  CameraEffects effects;
  effects.blur_px = 1.1;
  effects.exposure = 0.85;
  effects.mount[Index(CameraId::kTop)] = {.shift_mm = {0.4, -0.3, 0.5}, .turn_rad = {0.006, 0.004, -0.01}};
  effects.mount[Index(CameraId::kBottom)] = {.shift_mm = {-0.3, 0.5, -0.4},
                                             .turn_rad = {-0.005, 0.007, 0.012}};
  return effects;
}

// A link that sees solids.
class SolidLink {
 public:
  SolidLink() {
    PipelineOptions options;
    options.rest_frames = kRestFrames;
    pipeline_ = std::make_unique<LinkPipeline>(model_, options);
  }

  // The cameras are calibrated on the slack skin, which is tared where the baseline is another one; a few
  // frames on the way, and the scene for some: the state of the last frame.
  const LinkState& Show(const SolidScene& scene) {
    const std::vector<Vec3> slack(scene.markers_mm.size(), Vec3::Zero());
    for (int k = 0; k < kRestFrames; ++k) Process(slack, 0);
    if (scene.baseline_kpa > 0) {
      Go(slack, 0, scene.baseline_mm, scene.baseline_kpa);
      const TareOptions tare{.frames = kHeldFrames};
      if (pipeline_->BeginTare(tare)) {
        for (int k = 0; k < tare.frames; ++k) Process(scene.baseline_mm, scene.baseline_kpa);
        if (const auto end = pipeline_->TakeTareEnd(); end && !*end) tare_trouble_ = end->error().message;
      }
    }
    Go(scene.baseline_mm, scene.baseline_kpa, scene.markers_mm, scene.pressure_kpa);
    return state_;
  }
  const std::string& tare_trouble() const { return tare_trouble_; }

 private:
  void Go(const std::vector<Vec3>& from_mm, double from_kpa, const std::vector<Vec3>& to_mm, double to_kpa) {
    std::vector<Vec3> between(from_mm.size());
    for (int k = 1; k <= kWayFrames + kHeldFrames; ++k) {
      const double share = std::min(1.0, static_cast<double>(k) / kWayFrames);
      for (size_t m = 0; m < between.size(); ++m) between[m] = from_mm[m] + share * (to_mm[m] - from_mm[m]);
      Process(between, from_kpa + share * (to_kpa - from_kpa));
    }
  }
  void Process(const std::vector<Vec3>& displacements_mm, double kpa) {
    writer_.Write(displacements_mm, truth_);
    truth_.frame = ++frame_.sequence;
    truth_.pressure_mpa = 1e-3 * kpa;
    for (const CameraId id : kBothCameras) {
      renderer_.Render(truth_, id, gray_);
      PackYuyv(gray_, renderer_.chroma(id), frame_.images[Index(id)]);
    }
    frame_.pressure_mpa = truth_.pressure_mpa;
    pipeline_->Process(frame_, state_);
  }

  const LinkModel model_ = SolidSkin();
  const CameraEffects effects_ = OtherCameras();
  Renderer renderer_{model_, MountedRig(model_.nominal_rig, effects_), effects_, 7};
  SolidWriter writer_{model_};
  std::unique_ptr<LinkPipeline> pipeline_;
  SkinTruth truth_;
  StereoFrame frame_;
  cv::Mat gray_;
  LinkState state_;
  std::string tare_trouble_;
};

void AddShapeErrors(const SolidScene& scene, const LinkState& state, AccuracyRow& row) {
  const LinkModel model = SolidSkin();
  double sum = 0;
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const double off = (state.shape.positions_mm[i] - model.RestMarker(m) - scene.markers_mm[i]).norm();
    sum += off * off;
    row.shape_worst_mm = std::max(row.shape_worst_mm, off);
  }
  row.shape_rms_mm = std::sqrt(sum / model.markers.count());
}

}  // namespace

AccuracyRow SolveSolidImages(const SolidScene& scene) {
  SolidLink link;
  const LinkState& state = link.Show(scene);
  AccuracyRow row = MakeRow("images", scene, state);
  if (row.is_ok) AddShapeErrors(scene, state, row);
  if (!link.tare_trouble().empty()) row.fault += " " + link.tare_trouble();
  return row;
}

}  // namespace taclink
