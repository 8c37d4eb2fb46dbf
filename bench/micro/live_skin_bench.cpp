// How many equilibria per second the skin of a simulated link has while a body is moved on it, on one core:
// "items_per_second", of which the server needs 10. "slowest_ms" is the longest that one took.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <string>

#include "sensing/model/model_file.h"
#include "sensing/simulation/live_skin.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

constexpr double kTurnS = 6;  // in which the body moves to and fro
constexpr double kTurnRad = 0.6;

struct HandledCase {
  const char* model;
  double pressure_kpa;
  PressedBody body;
};

const HandledCase kCases[] = {
    {"cylinder", 0.8, {.id = 1, .shape = BodyShape::kFinger, .at = {0.5, 90}, .depth_mm = 6}},
    {"barrel", 0.8, {.id = 1, .shape = BodyShape::kFinger, .at = {0.5, 90}, .depth_mm = 6}},
    {"cylinder", 0, {.id = 1, .shape = BodyShape::kFinger, .at = {0.5, 90}, .depth_mm = 6}},
    {"cylinder", 0.8, {.id = 1, .shape = BodyShape::kHand, .at = {0.5, 90}, .force_n = 2}},
    {"barrel", 0, {.id = 1, .shape = BodyShape::kDisc, .diameter_mm = 60, .at = {0.5, 90}, .force_n = 1}},
};

void LiveEquilibria(benchmark::State& state) {
  const HandledCase& handled = kCases[state.range(0)];
  const Scene scene = ParseScene("bench",
                                 "taclink_scene: 1\nname: bench\nduration_s: 60\n"
                                 "pressure_keyframes: [{time_s: 0, kpa: " +
                                     std::to_string(handled.pressure_kpa) + "}]\n")
                          .value();
  const auto skin = SimulatedSkin::Make(LoadLinkModel(handled.model).value(), scene).value();
  SkinTruth truth;
  Handling handling{.bodies = {handled.body}};
  double time_s = 0, slowest_s = 0;
  for (auto _ : state) {
    time_s += LiveSkin::kKeySpanS;
    handling.bodies[0].at.angle_rad =
        handled.body.at.angle_rad + kTurnRad * std::sin(2 * std::numbers::pi * time_s / kTurnS);
    skin->Handle(handling);
    const auto begin = std::chrono::steady_clock::now();
    skin->Evaluate(time_s, truth);
    slowest_s =
        std::max(slowest_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["slowest_ms"] = 1e3 * slowest_s;
  state.counters["force_n"] = truth.total_force_n.norm();
  state.SetLabel(std::string(handled.model) + " " + std::to_string(handled.pressure_kpa) + " kPa");
}

BENCHMARK(LiveEquilibria)->DenseRange(0, 4)->ArgName("case")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace taclink
