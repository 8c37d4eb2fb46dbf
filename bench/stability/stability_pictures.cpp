// The whole way over every kind of skin: rest labels, calibration, tracker and estimator, from pictures.
#include <cmath>
#include <cstdio>
#include <limits>

#include "bench/force/accuracy_bench.h"
#include "bench/stability/stability_cases.h"
#include "bench/vision/vision_score.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

constexpr double kForceShare = 0.1, kForceN = 0.03, kDeviations = 3, kCenterMm = 4, kMarkerRmsMm = 0.3;
constexpr double kInflateS = 0.5, kInflatedS = 1.3, kPressS = 1.5, kRampS = 0.4, kEndS = 2.4;
constexpr double kDepthMm = 4, kPatchMm = 11, kRateHz = 30;

struct View {
  const char* name;
  CameraEffects effects;
};

std::vector<View> Views() {
  CameraEffects poor;
  poor.sensor_noise_levels = 4;
  poor.blur_px = 1.1;
  poor.exposure = 0.7;
  poor.dirt_specks = 4;
  poor.mount[Index(CameraId::kTop)] = {.shift_mm = {0.5, -0.3, 0.4}, .turn_rad = {0.008, 0.004, -0.012}};
  poor.mount[Index(CameraId::kBottom)] = {.shift_mm = {-0.3, 0.5, -0.4}, .turn_rad = {-0.005, 0.008, 0.01}};
  return {{"good pictures", {}}, {"poor pictures", poor}};
}

// Slack, inflated, pressed beside a marker in mid-length.
Scene SceneOf(const SkinCase& skin, const View& view) {
  const double length = UnitsOf(skin.model).length;
  Scene scene;
  scene.name = skin.name + ", " + view.name;
  scene.frame_rate_hz = kRateHz;
  scene.duration_s = kEndS;
  scene.loop = false;
  scene.pressure = {{kInflateS, 0}, {kInflatedS, 1e3 * skin.pressure_mpa}};
  SceneContact contact;
  contact.at = {.path = 0, .ring = 0, .angle_rad = 1.3, .z_mm = 0.45 * skin.model.length_mm};
  contact.patch_diameter_mm = kPatchMm * length;
  contact.depth_mm = kDepthMm * length;
  contact.begin_s = kPressS;
  contact.end_s = 2 * kEndS;
  contact.ramp_s = kRampS;
  contact.where = scene.name;
  scene.contacts = {contact};
  scene.camera = view.effects;
  return scene;
}

class PictureRun {
 public:
  PictureRun(const SkinCase& skin, const Scene& scene)
      : skin_(skin), scene_(scene), link_(skin.model, Options(skin)), scorer_(skin.model) {}

  StabilityRow Run() {
    auto simulated = SimulatedSkin::Make(skin_.model, scene_);
    if (!simulated) return Row(Ending::kRefused, "the skin itself: " + simulated.error().message);
    Play(**simulated);
    const std::string reasons = ReasonsOf(state_);
    if (state_.status == LinkStatus::kCalibrating)
      return Row(Ending::kRefused, "the rest pictures: " + state_.status_reason);
    CheckLabels();
    CheckShape();
    CheckForce();
    if (faults_.empty()) return Row(Ending::kRight, reasons.empty() ? "ok" : "right, but says: " + reasons);
    if (!reasons.empty()) return Row(Ending::kRefused, "it says: " + reasons + " (" + faults_ + ")");
    return Row(Ending::kWrong, "ok, but " + faults_);
  }

 private:
  static PipelineOptions Options(const SkinCase& skin) {
    PipelineOptions options;
    options.pressure_sigma_mpa = skin.pressure_sigma_mpa;
    return options;
  }
  StabilityRow Row(Ending ending, const std::string& reason) const {
    return {scene_.name, ending, reason, kNan, kNan, kNan, kNan, kNan};
  }
  void Add(const char* format, double a, double b = 0) {
    char text[120];
    std::snprintf(text, sizeof text, format, a, b);  // NOLINT(clang-diagnostic-format-nonliteral)
    faults_ += (faults_.empty() ? "" : ", ") + std::string(text);
  }

  void Play(SimulatedSkin& simulated) {
    const StereoRig rig = MountedRig(skin_.model.nominal_rig, scene_.camera);
    Renderer renderer(skin_.model, rig, scene_.camera, scene_.seed);
    StereoFrame pictures;
    cv::Mat gray;
    VisionResult result;
    for (int frame = 0; frame < kEndS * kRateHz; ++frame) {
      simulated.Evaluate(frame / kRateHz, truth_);
      for (const CameraId id : kBothCameras) {
        renderer.Render(truth_, id, gray);
        PackYuyv(gray, renderer.chroma(id), pictures.images[Index(id)]);
      }
      pictures.sequence = static_cast<uint64_t>(frame);
      pictures.times.exposure_monotonic_ns = static_cast<int64_t>((frame + 1) / kRateHz * 1e9);
      pictures.pressure_mpa = truth_.pressure_mpa;
      link_.Process(pictures, state_);
      if (state_.status == LinkStatus::kCalibrating) continue;
      result.labels = link_.labels();
      result.shape = state_.shape;
      MakeVisionTruth(skin_.model, rig, renderer, truth_, seen_);
      scorer_.Add(seen_, result);
    }
  }

  // Over all frames: one wrong label is one too many; one on dirt is only told with others.
  void CheckLabels() {
    for (const LabelCounts& labels : scorer_.score().labels) {
      if (labels.wrong > 0)
        Add("%.0f of %.0f labels wrong", static_cast<double>(labels.wrong),
            static_cast<double>(labels.labelled));
    }
    if (!faults_.empty()) faults_ += " (" + scorer_.incidents().labels.front() + ")";
  }
  // Of the last frame, from the baseline: where calibrated cameras put all of the link is not the skin's.
  void CheckShape() {
    double sum2 = 0;
    for (size_t m = 0; m < truth_.marker_mm.size(); ++m) {
      const Vec3 off = state_.shape.displacements_mm.empty()
                           ? Vec3::Constant(kNan)
                           : Vec3(state_.shape.displacements_mm[m] - seen_.displacements_mm[m]);
      sum2 += off.squaredNorm();
    }
    const double rms = std::sqrt(sum2 / static_cast<double>(truth_.marker_mm.size()));
    if (!(rms <= kMarkerRmsMm * UnitsOf(skin_.model).length)) Add("markers off by %.2g mm RMS", rms);
  }
  // One contact, or several where a disc's edge presses an inflated skin.
  void CheckForce() {
    const SkinUnits unit = UnitsOf(skin_.model);
    Vec3 center = Vec3::Zero();
    Mat3 covariance = 1e-12 * unit.force * unit.force * Mat3::Identity();
    double normal_n = 0;
    for (const Contact& contact : state_.contacts) {
      center += contact.normal_force_n * contact.center_mm;
      normal_n += contact.normal_force_n;
      covariance += contact.force_covariance_n2.value_or(Mat3::Zero());
    }
    const Vec3 error = state_.total_force_n - truth_.total_force_n;
    const double off = error.norm(), force = truth_.total_force_n.norm();
    if (off > std::max(kForceN * unit.force, kForceShare * force) &&
        !(std::sqrt(error.dot(covariance.ldlt().solve(error))) <= kDeviations))
      Add("force off by %.3g N of %.3g N", off, force);
    if (normal_n <= 0 || truth_.contacts.empty()) return;
    const double away = (center / normal_n - truth_.contacts.front().center_mm).norm();
    if (away > kCenterMm * unit.length) Add("center off by %.2g mm", away);
  }

  const SkinCase& skin_;
  const Scene scene_;
  LinkPipeline link_;
  VisionScorer scorer_;
  SkinTruth truth_;
  VisionTruth seen_;
  LinkState state_;
  std::string faults_;
};

}  // namespace

std::vector<StabilityRow> RunPictureCase(const SkinCase& skin) {
  std::vector<StabilityRow> rows;
  for (const View& view : Views()) rows.push_back(PictureRun(skin, SceneOf(skin, view)).Run());
  return rows;
}

}  // namespace taclink
