#include "bench/force/accuracy_bench.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <random>
#include <thread>

#include "bench/tools/child_process.h"
#include "bench/tools/thread_clock.h"
#include "sensing/contact/contact_finder.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/pipeline/state_estimator.h"
#include "sensing/simulation/random.h"

namespace taclink {
namespace {

constexpr double kExactMm = 0.01, kAxial = 3;
constexpr int kExactFrames = 2;
constexpr double kSpecificForceSigmaMps2 = 0.2;
constexpr double kFrameMm =
    1;  // that bodies move from frame to frame, at most: 30 mm/s at 30 frames a second

std::unique_ptr<StateEstimator> Make(const LinkModel& model, const ForceMethod& method) {
  ForceOptions options;
  options.model = method.model;
  options.refinement = method.refinement;
  return MakeStateEstimator(model, options);
}

double SecondsSince(int64_t start_ns) {
  return 1e-9 * static_cast<double>(ThreadCpuClock().MonotonicNs() - start_ns);
}

// Plays paths to one estimator.
class Player {
 public:
  Player(const LinkModel& model, const AccuracyOptions& options, AccuracyOutcome& outcome)
      : model_(model), options_(options), outcome_(outcome), finder_(model) {
    const int64_t start = ThreadCpuClock().MonotonicNs();
    estimator_ = Make(model, outcome.method);
    outcome.construction_s = SecondsSince(start);
  }

  void Play(const PathTruth& path, uint64_t path_seed) {
    if (path.inflated.displacements_mm.empty()) return;
    estimator_->Restart();
    finder_ = ContactFinder(model_);
    path_ = &path;
    seed_ = path_seed;
    if (path.path.bodies.empty()) {
      const bool is_at_rest = path.path.pressure_mpa == 0 && path.path.attitude.empty();
      Score(path.inflated, is_at_rest ? &outcome_.rest_cpu_ms : nullptr);
      return;
    }
    Show(path.inflated, nullptr);
    const TrueStage* from = &path.inflated;
    for (const TrueStage& stage : path.stages) {
      Approach(*from, stage);
      Score(stage, &outcome_.cpu_ms);
      from = &stage;
    }
  }

 private:
  // On the way from stage to stage the markers move straight.
  void Approach(const TrueStage& from, const TrueStage& to) {
    const double way =
        std::hypot(to.stage.depth_mm - from.stage.depth_mm, to.stage.drag_mm - from.stage.drag_mm);
    const int parts = static_cast<int>(std::ceil(way / kFrameMm));
    TrueStage between = to;
    for (int part = 1; part < parts; ++part) {
      const double share = static_cast<double>(part) / parts;
      for (size_t m = 0; m < to.displacements_mm.size(); ++m) {
        between.displacements_mm[m] = (1 - share) * from.displacements_mm[m] + share * to.displacements_mm[m];
      }
      Show(between, &outcome_.cpu_ms);
    }
  }

  void Show(const TrueStage& stage, std::vector<float>* times) {
    seed_ = MixBits(seed_);
    MakeShape(model_, stage, outcome_.noise_mm, seed_, shape_);
    const LoadsPair loads = LoadsOf(path_->path, PressureSigma(PressureOrigin::kSimulated), seed_);
    const int64_t start = ThreadCpuClock().MonotonicNs();
    estimator_->Estimate(loads, shape_, forces_);
    estimator_->FindContacts(finder_, shape_, forces_, contacts_);
    if (times) times->push_back(static_cast<float>(1e3 * SecondsSince(start)));
    ++outcome_.frames;
    outcome_.not_converged += forces_.converged ? 0 : 1;
    if (!stage.contacts.empty()) ++outcome_.answered[Name(forces_.model)];
  }

  void Score(const TrueStage& stage, std::vector<float>* times) {
    SceneScores scene{.path = path_, .truth = &stage, .frames = {}};
    const int frames = outcome_.noise_mm > 0 ? options_.frames : std::min(options_.frames, kExactFrames);
    for (int frame = 0; frame < frames; ++frame) {
      Show(stage, times);
      scene.frames.push_back(ScoreContacts(model_, stage, forces_, contacts_));
    }
    outcome_.scenes.push_back(std::move(scene));
  }

  const LinkModel& model_;
  const AccuracyOptions& options_;
  AccuracyOutcome& outcome_;
  std::unique_ptr<StateEstimator> estimator_;
  ContactFinder finder_;
  const PathTruth* path_ = nullptr;
  uint64_t seed_ = 0;
  SkinShape shape_;
  NodalForces forces_;
  std::vector<Contact> contacts_;
};

// In a process of its own, with a few frames so that scratch memory counts.
double MemoryOf(const LinkModel& model, const ForceMethod& method, const std::vector<PathTruth>& truths) {
  return ResidentGrowthMb([&] {
    auto estimator = Make(model, method);
    ContactFinder finder(model);
    SkinShape shape;
    NodalForces forces;
    std::vector<Contact> contacts;
    int shown = 0;
    for (const PathTruth& path : truths) {
      if (path.stages.empty() || ++shown > 3) continue;
      MakeShape(model, path.stages.back(), 0.05, 1, shape);
      const double pressure_sigma = PressureSigma(PressureOrigin::kSimulated);
      estimator->Estimate(LoadsOf(path.path, pressure_sigma, 1), shape, forces);
      estimator->FindContacts(finder, shape, forces, contacts);
    }
    return estimator;
  });
}

// fn(0) to fn(count - 1), on some threads.
void InParallel(size_t count, int jobs, const std::function<void(int, int)>& progress,
                const std::function<void(size_t)>& fn) {
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  int done = 0;
  const auto work = [&] {
    for (size_t i = next++; i < count; i = next++) {
      fn(i);
      const std::lock_guard lock(mutex);
      ++done;
      if (progress) progress(done, static_cast<int>(count));
    }
  };
  std::vector<std::thread> workers;
  for (int i = 1; i < jobs; ++i) workers.emplace_back(work);
  work();
  for (std::thread& worker : workers) worker.join();
}

}  // namespace

void MakeShape(const LinkModel& model, const TrueStage& truth, double noise_mm, uint64_t seed,
               SkinShape& shape) {
  const auto count = static_cast<size_t>(model.markers.count());
  std::mt19937_64 bits(MixBits(seed));
  std::normal_distribution<double> normal;
  const double sigma = noise_mm > 0 ? noise_mm : kExactMm;
  const Vec3 sigmas(sigma, sigma, kAxial * sigma);
  shape.positions_mm.resize(count);
  shape.displacements_mm.resize(count);
  shape.measured.resize(count);
  shape.covariances_mm2.assign(count, sigmas.cwiseAbs2().asDiagonal());
  shape.sources.assign(count, MarkerSource::kBoth);
  for (size_t m = 0; m < count; ++m) {
    const Vec3 baseline = truth.baseline_mm.empty() ? Vec3(Vec3::Zero()) : truth.baseline_mm[m];
    Vec3 u = truth.displacements_mm[m] - baseline;
    if (noise_mm > 0) {
      for (int c = 0; c < 3; ++c) u[c] += sigmas[c] * normal(bits);
    }
    shape.displacements_mm[m] = u;
    shape.positions_mm[m] = model.RestMarker(static_cast<int>(m)) + baseline + u;
    shape.measured[m] = {u, sigmas.cwiseAbs2().cwiseInverse().asDiagonal()};
  }
}

LoadsPair LoadsOf(const PressPath& path, double pressure_sigma_mpa, uint64_t seed) {
  LoadsPair loads;
  loads.now.pressure_mpa = path.pressure_mpa;
  loads.now.pressure_sigma_mpa = pressure_sigma_mpa;
  if (path.attitude.empty()) return loads;
  std::mt19937_64 bits(MixBits(~seed));  // others than the markers'
  std::normal_distribution<double> normal;
  loads.now.specific_force_mps2 = path.specific_force_mps2;
  for (int c = 0; c < 3; ++c) loads.now.specific_force_mps2[c] += kSpecificForceSigmaMps2 * normal(bits);
  loads.now.specific_force_covariance = kSpecificForceSigmaMps2 * kSpecificForceSigmaMps2 * Mat3::Identity();
  loads.baseline.specific_force_mps2 = path.baseline_specific_force_mps2;
  return loads;
}

std::vector<AccuracyOutcome> RunAccuracyBench(const LinkModel& model, const std::vector<PathTruth>& truths,
                                              const AccuracyOptions& options) {
  std::vector<AccuracyOutcome> outcomes;
  for (const ForceMethod& method : options.methods) {
    const double memory = MemoryOf(model, method, truths);
    for (const double noise : options.noises_mm) {
      AccuracyOutcome& outcome = outcomes.emplace_back();
      outcome.method = method;
      outcome.model = model.name;
      outcome.noise_mm = noise;
      outcome.memory_mb = memory;
    }
  }
  InParallel(outcomes.size(), options.jobs, options.progress, [&](size_t i) {
    Player player(model, options, outcomes[i]);
    for (size_t k = 0; k < truths.size(); ++k) player.Play(truths[k], MixBits(options.seed + k));
  });
  return outcomes;
}

Result<std::vector<PathTruth>> MakeTruths(const LinkModel& model, const std::vector<PressPath>& paths,
                                          int refinement, const std::string& folder, int jobs,
                                          const std::function<void(int done, int all)>& progress) {
  std::vector<PathTruth> truths(paths.size());
  std::optional<Error> error;
  std::mutex mutex;
  InParallel(paths.size(), jobs, progress, [&](size_t i) {
    auto truth = CachedPath(model, paths[i], refinement, folder);
    const std::lock_guard lock(mutex);
    if (truth) {
      truths[i] = std::move(*truth);
    } else if (!error) {
      error = truth.error();
    }
  });
  if (error) return *error;
  return truths;
}

}  // namespace taclink
