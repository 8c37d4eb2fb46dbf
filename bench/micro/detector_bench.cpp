// The detector alone, on one picture of a dented cylinder, by what the camera does to it.
#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>

#include "sensing/markers/detect/detector.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

void DetectOne(benchmark::State& state, const CameraEffects& effects) {
  cv::setNumThreads(1);
  const LinkModel model = LoadLinkModel("cylinder").value();
  Scene scene = LoadScene("press").value();
  scene.skin = SkinKind::kLinear;
  scene.contacts.front().force_n.reset();
  scene.contacts.front().depth_mm = 12;
  const auto skin = SimulatedSkin::Make(model, scene).value();
  SkinTruth truth;
  skin->Evaluate(3, truth);
  cv::Mat gray;
  Renderer(model, model.nominal_rig, effects, 1).Render(truth, CameraId::kTop, gray);
  MarkerDetector detector;
  Detections found;
  for (auto _ : state) detector.Detect(gray, found);
  state.counters["found"] = static_cast<double>(found.size());
}

BENCHMARK_CAPTURE(DetectOne, nominal, CameraEffects{})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(DetectOne, dark, CameraEffects{.exposure = 0.25})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(DetectOne, overexposed, CameraEffects{.exposure = 4})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(DetectOne, noisy, CameraEffects{.sensor_noise_levels = 8})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(DetectOne, defocused, CameraEffects{.blur_px = 1.5})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace taclink
