// The shape stage alone: right labels with 0.3 px of noise, new in every frame. One core. Pushes: 0 to 3.
#include <benchmark/benchmark.h>

#include <cmath>

#include "sensing/model/model_file.h"
#include "sensing/shape/reconstructor.h"
#include "tests/sensing/shape/support.h"

namespace taclink {
namespace {

constexpr double kNoisePx = 0.3;
constexpr int kFrames = 16;

void Shape(benchmark::State& state) {
  const LinkModel model = LoadLinkModel(state.range(0) == 0 ? "cylinder" : "barrel").value();
  const std::vector<Push> all = {{0.3, 0.5, 8}, {2.2, 0.3, 12}, {4.4, 0.7, 6}};
  const auto truth = TrueMarkers(model, {all.begin(), all.begin() + state.range(1)});
  Eyes eyes(model.nominal_rig);
  ShapeReconstructor reconstructor(model, model.nominal_rig,
                                   {.cameras = {.domes = false}, .estimator = {}});  // points
  reconstructor.SetBaseline(eyes.See(model.RestMarkers(), kNoisePx / std::sqrt(8.0)));
  std::vector<LabelledMarkers> frames;
  for (int i = 0; i < kFrames; ++i) frames.push_back(eyes.See(truth, kNoisePx));
  SkinShape shape;
  size_t next = 0;
  double squares = 0, n = 0;
  for (auto _ : state) reconstructor.Reconstruct(frames[next++ % kFrames], 0, shape);
  for (size_t m = 0; m < truth.size(); ++m, ++n) squares += (shape.positions_mm[m] - truth[m]).squaredNorm();
  state.counters["rmse_mm"] = std::sqrt(squares / n);
  state.counters["fields"] = static_cast<double>(reconstructor.solver().fields().size());
}

void ShapeStart(benchmark::State& state) {
  const LinkModel model = LoadLinkModel(state.range(0) == 0 ? "cylinder" : "barrel").value();
  for (auto _ : state) benchmark::DoNotOptimize(ShapeReconstructor(model, model.nominal_rig));
}

BENCHMARK(Shape)
    ->ArgsProduct({{0, 1}, {0, 1, 2, 3}})
    ->ArgNames({"barrel", "pushes"})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(ShapeStart)->Arg(0)->Arg(1)->ArgName("barrel")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace taclink
