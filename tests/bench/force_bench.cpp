// The force models alone: markers of a stamp on the nonlinear skin, 0.05 mm of noise (z three times worse),
// new in every frame. One core.
#include <benchmark/benchmark.h>

#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

#include "sensing/force/force_estimator.h"
#include "sensing/force/nonlinear_estimator.h"
#include "sensing/force/pressurised_tangents.h"
#include "sensing/mechanics/pressed_skin.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kNoiseMm = 0.05;
constexpr double kPressureMpa = 1e-3;
constexpr double kDeepestMm = 8;
constexpr int kNoises = 4;

using Markers = std::vector<Vec3>;

// By depth in steps of 1 mm, which is 30 mm/s at 30 frames a second; first without the stamp.
const std::vector<Markers>& PushedMarkers(const LinkModel& model) {
  static const std::vector<Markers> kStages = [&] {
    PressedSkin skin(model, {.refinement = 3});
    skin.Inflate(kPressureMpa);
    const auto displacements = [&] {
      Markers moved;
      for (int m = 0; m < model.markers.count(); ++m) moved.push_back(skin.Marker(m) - model.RestMarker(m));
      return moved;
    };
    std::vector<Markers> stages = {displacements()};
    const auto node = static_cast<size_t>(skin.mesh().NodeOfMarker(model, model.MarkerIndex(6, 4)));
    const Vec3 axis = skin.mesh().normals[node];
    skin.AddBody(RigidStamp{skin.state().mids_mm[node] + (model.thickness_mm / 2 + 0.01) * axis, -axis, 2.75},
                 true);
    for (double depth = 1; depth <= kDeepestMm; ++depth) {
      const Vec3 by = -axis;
      skin.Move({&by, 1});
      stages.push_back(displacements());
    }
    return stages;
  }();
  return kStages;
}

SkinShape Measured(const LinkModel& model, const Markers& displacements, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Mat3 covariance = Vec3(1, 1, 9).asDiagonal() * (kNoiseMm * kNoiseMm);
  SkinShape shape;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec3 error(kNoiseMm * normal(random), kNoiseMm * normal(random), 3 * kNoiseMm * normal(random));
    const Vec3 u = displacements[static_cast<size_t>(m)] + error;
    shape.displacements_mm.push_back(u);
    shape.positions_mm.push_back(model.RestMarker(m) + u);
    shape.measured.push_back({u, covariance.inverse()});
    shape.sources.push_back(MarkerSource::kBoth);
  }
  return shape;
}

enum Motion { kRest, kStanding, kMoving };

// In and out again, or where it is.
std::vector<SkinShape> Frames(const LinkModel& model, Motion motion) {
  const std::vector<Markers>& stages = PushedMarkers(model);
  std::vector<SkinShape> frames;
  const auto add = [&](size_t stage) {
    frames.push_back(Measured(model, stages[stage], static_cast<unsigned>(frames.size())));
  };
  if (motion == kMoving) {
    for (size_t i = 1; i < stages.size(); ++i) add(i);
    for (size_t i = stages.size() - 1; i > 1; --i) add(i - 1);
  } else {
    for (int i = 0; i < kNoises; ++i) add(motion == kRest ? 0 : 5);
  }
  return frames;
}

void Force(benchmark::State& state) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const auto force_model = static_cast<ForceModel>(state.range(0));
  const auto motion = static_cast<Motion>(state.range(2));
  const auto estimator =
      MakeForceEstimator(model, {.model = force_model, .refinement = static_cast<int>(state.range(1))});
  const std::vector<SkinShape> frames = Frames(model, motion);
  NodalForces forces;
  for (const SkinShape& frame : frames) estimator->Estimate(frame, kPressureMpa, forces);
  NonlinearEstimator::Work work;
  if (const auto* nonlinear = dynamic_cast<const NonlinearEstimator*>(estimator.get())) {
    work = nonlinear->work();
  }
  size_t next = 0;
  int unsolved = 0;
  for (auto _ : state) {
    estimator->Estimate(frames[next++ % frames.size()], kPressureMpa, forces);
    unsolved += forces.converged ? 0 : 1;
  }
  Vec3 total = Vec3::Zero();
  for (const Vec3& f : forces.forces_n) total += f;
  state.counters["force_n"] = total.norm();
  state.counters["unsolved"] = unsolved;
  if (const auto* nonlinear = dynamic_cast<const NonlinearEstimator*>(estimator.get())) {
    const auto per_frame = [&](long all, long before) {
      return static_cast<double>(all - before) / static_cast<double>(state.iterations());
    };
    state.counters["iterations"] = per_frame(nonlinear->work().iterations, work.iterations);
    state.counters["factorisations"] = per_frame(nonlinear->work().factorisations, work.factorisations);
  }
  state.SetLabel(std::string(Name(force_model)) + (motion == kRest       ? " rest"
                                                   : motion == kStanding ? " standing"
                                                                         : " moving"));
}

// A link's first inflation to 1.5 kPa, a frame each 0.01 kPa.
void FirstInflation(benchmark::State& state) {
  using Clock = std::chrono::steady_clock;
  const LinkModel model = LoadLinkModel("cylinder").value();
  const int refinement = static_cast<int>(state.range(0));
  const LoadSites sites = MakeLoadSites(model, MakeShellMesh(model, refinement));
  Clock::duration worst{};
  for (auto _ : state) {
    PressurisedTangents tangents(model, refinement, sites);
    for (int frame = 0; frame <= 150; ++frame) {
      const Clock::time_point begin = Clock::now();
      benchmark::DoNotOptimize(tangents.At(0.01e-3 * frame));
      worst = std::max(worst, Clock::now() - begin);
    }
  }
  state.counters["worst_frame_ms"] = std::chrono::duration<double, std::milli>(worst).count();
}
BENCHMARK(FirstInflation)->Arg(1)->Arg(2)->ArgName("refinement")->Unit(benchmark::kMillisecond);

BENCHMARK(Force)
    ->ArgsProduct({{static_cast<int>(ForceModel::kLinear), static_cast<int>(ForceModel::kPressurised),
                    static_cast<int>(ForceModel::kNonlinear)},
                   {1, 2},
                   {kRest, kStanding, kMoving}})
    ->ArgNames({"model", "refinement", "motion"})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace taclink
