#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sensing/model/model_file.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

constexpr double kRateHz = 10, kTouchedS = 2;
constexpr int kRestFrames = 8;

// A push of 0.2 N at one marker, from 1 s on; every marker's picture is shifted by 0.3 px of noise.
Scene PushScene(const LinkModel& model, int marker) {
  Scene scene;
  scene.name = "push";
  scene.model = model.name;
  scene.skin = SkinKind::kLinear;  // as the force model
  scene.frame_rate_hz = kRateHz;
  scene.duration_s = 3;
  scene.seed = static_cast<uint64_t>(marker) + 1;
  scene.pressure = {{0, 0}};
  scene.camera.marker_jitter_px = 0.3;
  SceneContact contact;
  contact.at.path = model.PathOf(marker) + 1;
  contact.at.ring = model.RingOf(marker) + 1;
  contact.force_n = 0.2;
  contact.begin_s = 1;
  contact.end_s = 3;
  contact.ramp_s = 0.1;
  scene.contacts = {contact};
  return scene;
}

class PushTest : public ::testing::TestWithParam<std::string> {
 protected:
  struct Solved {
    LinkState state;
    SkinTruth truth;
  };

  Solved Solve(const Scene& scene, double touched_s = kTouchedS,
               std::optional<ForceModel> force_model = ForceModel::kLinear) const {
    auto skin = SimulatedSkin::Make(model_, scene);
    Renderer renderer(model_, model_.nominal_rig, scene.camera, scene.seed);
    PipelineOptions options;
    options.rest_frames = kRestFrames;
    options.force.model = force_model;
    LinkPipeline pipeline(model_, options);
    Solved solved;
    StereoFrame frame;
    cv::Mat gray;
    const auto take = [&](double time_s) {
      (*skin)->Evaluate(time_s, solved.truth);
      for (const CameraId id : kBothCameras) {
        renderer.Render(solved.truth, id, gray);
        PackYuyv(gray, renderer.chroma(id), frame.images[Index(id)]);
      }
      frame.pressure_mpa = solved.truth.pressure_mpa;
      pipeline.Process(frame, solved.state);
    };
    for (int k = 0; k < kRestFrames; ++k) take(k / kRateHz);
    take(touched_s);
    return solved;
  }

  const LinkModel model_ = LoadLinkModel(GetParam()).value();
};

// 0.2 N: force within 25 %, centre within 8 mm, nothing that is not there.
TEST_P(PushTest, EveryPlaceOfTheSkin) {
  double worst_force = 0, worst_center = 0;
  std::vector<double> forces;
  for (int marker = 0; marker < model_.markers.count(); marker += 5) {
    SCOPED_TRACE("path " + std::to_string(model_.PathOf(marker) + 1) + ", ring " +
                 std::to_string(model_.RingOf(marker) + 1));
    const int ring = model_.RingOf(marker);
    const bool beside_clamp = ring == 0 || ring == model_.markers.rings() - 1;
    const Solved solved = Solve(PushScene(model_, marker));
    ASSERT_TRUE(solved.state.measured()) << solved.state.status_reason;
    EXPECT_EQ(solved.state.contacts.size(), 1u);
    if (solved.state.contacts.empty()) continue;
    const Contact& found = solved.state.contacts[0];
    const TrueContact& real = solved.truth.contacts.at(0);
    const double force_error = (found.force_n - real.force_n).norm() / real.force_n.norm();
    const double center_error = (found.center_mm - real.center_mm).norm();
    // Beside a clamp, the same markers may tell of a larger force still nearer to it, which the link then
    // says.
    const bool is_said = std::any_of(solved.state.reasons.begin(), solved.state.reasons.end(),
                                     [](const Reason& why) { return why.id == ReasonId::kBeyondMarkers; });
    EXPECT_TRUE(beside_clamp || !is_said);
    EXPECT_LT(force_error, is_said ? 0.65 : 0.25);
    EXPECT_LT(center_error, 8);
    worst_force = std::max(worst_force, force_error);
    worst_center = std::max(worst_center, center_error);
    forces.push_back(force_error);
  }
  std::sort(forces.begin(), forces.end());
  std::printf("%s: %zu pushes, force error median %.1f %%, worst %.1f %%; worst centre %.1f mm\n",
              GetParam().c_str(), forces.size(), 100 * forces[forces.size() / 2], 100 * worst_force,
              worst_center);
}

// The walls beside the ends of an inflated skin tilt, which must not look like forces.
TEST_P(PushTest, OnlyWhatTouchesAnInflatedSkinIsAContact) {
  Scene scene = LoadScene("inflate").value();
  constexpr double kInflatedS = 4.5, kHeldS = 6.5;
  EXPECT_THAT(Solve(scene, kInflatedS, std::nullopt).state.contacts, ::testing::IsEmpty());
  const Solved held = Solve(scene, kHeldS, std::nullopt);
  ASSERT_EQ(held.state.contacts.size(), 1u) << held.state.status_reason;
  const TrueContact& real = held.truth.contacts.at(0);
  EXPECT_NEAR(held.truth.pressure_mpa, 1.5e-3, 1e-9);
  EXPECT_LT((held.state.contacts[0].force_n - real.force_n).norm(), 0.25 * real.force_n.norm());
  EXPECT_LT((held.state.contacts[0].center_mm - real.center_mm).norm(), 8);
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, PushTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
