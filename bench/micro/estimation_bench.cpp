// The estimator alone: markers of a stamp on a finer skin, 0.05 mm of noise (z three times worse), new in
// every frame. One core.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

#include "sensing/model/model_file.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/pipeline/state_estimator.h"
#include "sensing/shell/pressed_skin.h"

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
    shape.measured.push_back({u, covariance.inverse()});
    shape.sources.push_back(MarkerSource::kBoth);
  }
  return shape;
}

// From nowhere: it is there in a frame and was not in the one before. Cold: in the first frame of all.
enum Motion { kRest, kStanding, kMoving, kFromNowhere, kCold };

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

// Of a link that moves, the error of the measured specific force is estimated as well.
LoadsPair Loads(bool has_attitude) {
  LoadsPair loads{
      .now = {.pressure_mpa = kPressureMpa, .pressure_sigma_mpa = PressureSigma(PressureOrigin::kSimulated)},
      .baseline = {}};
  constexpr double kSigmaMps2 = 0.2;
  if (has_attitude) {
    loads.now.specific_force_covariance = kSigmaMps2 * kSigmaMps2 * Mat3::Identity();
    loads.baseline.specific_force_covariance = loads.now.specific_force_covariance;
  }
  return loads;
}

void Estimation(benchmark::State& state) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const auto motion = static_cast<Motion>(state.range(0));
  StateEstimator estimator(model, {});
  ContactFinder finder(model);
  std::vector<SkinShape> frames = Frames(model, motion);
  NodalForces forces;
  std::vector<Contact> contacts;
  const LoadsPair loads = Loads(state.range(1) == 1);
  const auto estimate = [&](SkinShape& frame) {
    estimator.Estimate(loads, frame, forces);
    estimator.FindContacts(finder, frame, forces, contacts);
  };
  SkinShape untouched = Measured(model, PushedMarkers(model)[0], kNoises);
  for (SkinShape& frame : frames) estimate(frame);
  size_t next = 0;
  int unsolved = 0;
  double tangents = 0, steps = 0;
  for (auto _ : state) {
    if (motion == kCold) estimator.Restart();
    if (motion == kFromNowhere) {
      state.PauseTiming();
      estimate(untouched);
      state.ResumeTiming();
    }
    estimate(frames[next++ % frames.size()]);
    unsolved += forces.converged ? 0 : 1;
    tangents += estimator.estimate().work.tangents;
    steps += estimator.estimate().work.steps;
  }
  Vec3 total = Vec3::Zero();
  for (const Vec3& f : forces.forces_n) total += f;
  state.counters["force_n"] = total.norm();
  state.counters["unsolved"] = unsolved;
  state.counters["tangents"] = tangents / static_cast<double>(state.iterations());
  state.counters["steps"] = steps / static_cast<double>(state.iterations());
}

// As a link's worker does it: a frame every 33 ms, so that caches are cold. The time is that from a frame to
// its answer; over all frames also the median, the 99th percentile and the longest.
void LiveEstimation(benchmark::State& state) {
  using Clock = std::chrono::steady_clock;
  constexpr auto kPeriod = std::chrono::microseconds(33333);
  const LinkModel model = LoadLinkModel("cylinder").value();
  StateEstimator estimator(model, {});
  ContactFinder finder(model);
  std::vector<SkinShape> frames = Frames(model, static_cast<Motion>(state.range(0)));
  NodalForces forces;
  std::vector<Contact> contacts;
  const LoadsPair pressure{.now = {kPressureMpa, PressureSigma(PressureOrigin::kSimulated)}, .baseline = {}};
  std::vector<double> times_ms;
  double tangents = 0;
  size_t next = 0;
  Clock::time_point due = Clock::now();
  const auto take = [&] {
    // Not asleep: how a processor wakes up is not what is measured.
    for (due += kPeriod; Clock::now() < due;) {
    }
    const Clock::time_point begin = Clock::now();
    SkinShape& frame = frames[next++ % frames.size()];
    estimator.Estimate(pressure, frame, forces);
    estimator.FindContacts(finder, frame, forces, contacts);
    return std::chrono::duration<double>(Clock::now() - begin).count();
  };
  for (size_t i = 0; i < frames.size(); ++i) take();
  for (auto _ : state) {
    const double s = take();
    state.SetIterationTime(s);
    times_ms.push_back(1e3 * s);
    tangents += estimator.estimate().work.tangents;
  }
  std::sort(times_ms.begin(), times_ms.end());
  const auto at = [&](size_t percent) { return times_ms[(times_ms.size() - 1) * percent / 100]; };
  state.counters["median_ms"] = at(50);
  state.counters["p99_ms"] = at(99);
  state.counters["longest_ms"] = at(100);
  state.counters["remade"] = tangents;
}

BENCHMARK(LiveEstimation)
    ->DenseRange(kRest, kMoving)
    ->ArgName("rest_standing_moving")
    ->Iterations(300)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

BENCHMARK(Estimation)
    ->ArgsProduct({{kRest, kStanding, kMoving, kFromNowhere, kCold}, {0, 1}})
    ->ArgNames({"rest_standing_moving_nowhere_cold", "attitude"})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace taclink
