// The estimator against three-dimensional solids that another program solved. TACLINK_SOLIDS=NAME prints the
// scenes whose name begins so, one by one, with what is wrong of each.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>

#include "sensing/pipeline/marker_solve.h"
#include "tests/accuracy/solid_judge.h"
#include "tests/accuracy/solid_scenes.h"

namespace taclink {
namespace {

constexpr double kPressureSigmaMpa = 5e-5;

struct How {
  const char* name;
  double noise_mm = 0, missing = 0, pressure_off_pa = 0;
  int wrong = 0;  // markers that are somewhere else, by up to 10 mm
};

unsigned SeedOf(const SolidScene& scene, const How& how) {
  unsigned seed = 2166136261u;  // FNV-1a: the same everywhere, unlike std::hash
  for (const char c : scene.name + how.name) seed = (seed ^ static_cast<unsigned char>(c)) * 16777619u;
  return seed;
}

struct Shown {
  SkinShape shape;
  PressurePair pressure;
};

Shown Show(const SolidScene& scene, const How& how) {
  std::mt19937 random(SeedOf(scene, how));
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> lot(0, 1);
  const double sigma_mm = std::max(how.noise_mm, 0.02);
  Shown shown;
  for (size_t m = 0; m < scene.markers_mm.size(); ++m) {
    Vec3 at = scene.markers_mm[m] - scene.baseline_mm[m];
    for (int c = 0; c < 3; ++c) at[c] += how.noise_mm * normal(random);
    const bool seen = lot(random) >= how.missing;
    shown.shape.measured.push_back(seen ? MeasuredDisplacement{at, Mat3::Identity() / (sigma_mm * sigma_mm)}
                                        : MeasuredDisplacement{});
    shown.shape.sources.push_back(seen ? MarkerSource::kBoth : MarkerSource::kInferred);
  }
  for (int i = 0; i < how.wrong; ++i) {
    const auto m = static_cast<size_t>(lot(random) * static_cast<double>(scene.markers_mm.size()));
    const Vec3 way = Vec3(normal(random), normal(random), normal(random)).normalized();
    shown.shape.measured[m].displacement_mm += 10 * lot(random) * way;
  }
  shown.pressure.now = {scene.pressure_kpa * 1e-3 + how.pressure_off_pa * 1e-6, kPressureSigmaMpa};
  shown.pressure.baseline = {scene.baseline_kpa * 1e-3, scene.baseline_kpa > 0 ? kPressureSigmaMpa : 0};
  return shown;
}

struct Score {
  int held = 0, all = 0, said = 0;  // said: does not hold, and the residual is large
  int forces = 0, within_2_sigma = 0;
  double rms_mm = 0, worst_mm = 0;
  std::vector<double> ratios;  // of a contact's force along the true one, to that
  double Share() const { return static_cast<double>(held) / std::max(all, 1); }
};
using Scores = std::map<std::string, Score>;

// From the baseline, as displacements are told and published.
void AddShape(const SolidScene& scene, const SkinShape& shape, Score& score) {
  double sum = 0;
  for (size_t m = 0; m < scene.markers_mm.size(); ++m) {
    const double off = (shape.displacements_mm[m] - (scene.markers_mm[m] - scene.baseline_mm[m])).norm();
    sum += off * off;
    score.worst_mm = std::max(score.worst_mm, off);
  }
  score.rms_mm = std::max(score.rms_mm, std::sqrt(sum / static_cast<double>(scene.markers_mm.size())));
}

// Contacts that are one for one.
void AddSigmas(const SolidScene& scene, const std::vector<Contact>& found, Score& score) {
  for (const SolidContact& c : scene.contacts) {
    for (const Contact& f : found) {
      if ((f.center_mm - c.center_mm).norm() > 10 || !f.force_covariance_n2) continue;
      ++score.forces;
      const Vec3 off = f.force_n - c.force_n;
      if (c.force_n.norm() > 0.5 * c.normal_force_n)
        score.ratios.push_back(f.force_n.dot(c.force_n) / c.force_n.squaredNorm());
      score.within_2_sigma += off.norm() < 2 * std::sqrt(f.force_covariance_n2->trace());
    }
  }
}

double MedianOf(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Scores ScoreAll(const How& how) {
  const LinkModel model = SolidSkin();
  StateEstimator estimator(model, {});
  const char* only = std::getenv("TACLINK_SOLIDS");
  Scores scores;
  for (const SolidScene& scene : ReadSolidScenes()) {
    if (only != nullptr && !scene.name.starts_with(only)) continue;
    const Shown shown = Show(scene, how);
    const LinkState state = SolveMarkers(model, estimator, shown.pressure, shown.shape);
    const std::string fault = state.forces.converged ? FaultOf(scene, state.contacts) : "no answer";
    const bool said = state.status != LinkStatus::kOk;
    for (const std::string& key :
         {std::string("all"), scene.family, std::string(scene.held_out ? "held out" : "not held out")}) {
      Score& score = scores[key];
      ++score.all;
      score.held += fault.empty();
      score.said += !fault.empty() && said;
      if (!said) AddShape(scene, state.shape, score);
      AddSigmas(scene, state.contacts, score);
    }
    if (!fault.empty() || only != nullptr)
      std::printf("  %s%s %s: %s; %s, residual %.2f, region %.1f, %.0f Pa off\n", scene.name.c_str(),
                  scene.held_out ? " (held out)" : "", how.name, fault.empty() ? "holds" : fault.c_str(),
                  said ? state.status_reason.c_str() : "ok", state.forces.residual,
                  state.forces.region_residual, 1e6 * estimator.estimate().loads.pressure_error_mpa);
  }
  for (auto& [name, s] : scores)
    std::printf(
        "%-12s %-13s %3d of %3d hold, %d more say that they don't; RMSE to %.3f mm, worst %.2f mm; 2 sigma: "
        "%.0f %% of %d; forces %.3f of the true ones\n",
        how.name, name.c_str(), s.held, s.all, s.said, s.rms_mm, s.worst_mm,
        100.0 * s.within_2_sigma / std::max(s.forces, 1), s.forces, MedianOf(s.ratios));
  return scores;
}

struct Expected {
  How how;
  double share;   // of the scenes hold, at least
  double silent;  // do not, and are ok, at most
  double rms_mm = 0.15, worst_mm = 1.2;
};
class Solids : public ::testing::TestWithParam<Expected> {};

TEST_P(Solids, ForcesHold) {
  const Scores scores = ScoreAll(GetParam().how);
  ASSERT_GE(scores.at("all").all, 40) << "tests/accuracy/calculix has no scenes";
  EXPECT_GE(scores.at("all").Share(), GetParam().share);
  EXPECT_GE(scores.at("held out").Share(), GetParam().share);
  for (const char* key : {"all", "held out"}) {
    const Score& score = scores.at(key);
    EXPECT_LE(score.all - score.held - score.said, GetParam().silent * score.all) << key;
    EXPECT_LE(score.rms_mm, GetParam().rms_mm) << key;
    EXPECT_LE(score.worst_mm, GetParam().worst_mm) << key;
  }
}

INSTANTIATE_TEST_SUITE_P(Markers, Solids,
                         ::testing::Values(Expected{{"exact"}, 0.93, 0.03},
                                           Expected{{"noise", 0.1}, 0.93, 0.03},
                                           Expected{{"missing", 0, 0.2}, 0.95, 0.03},
                                           Expected{{"both", 0.1, 0.2}, 0.90, 0.08, 0.16},
                                           Expected{{"100 Pa", 0.1, 0, 100}, 0.95, 0.05},
                                           Expected{{"wrong", 0.1, 0, 0, 3}, 0.8, 0.07, 0.2, 2.5}),
                         [](const auto& at) { return "Case" + std::to_string(at.index); });

// What presses alike all around is one contact without a resultant.
TEST(SolidsTest, AHugIsOneContact) {
  const LinkModel model = SolidSkin();
  StateEstimator estimator(model, {});
  int hugs = 0;
  for (const SolidScene& scene : ReadSolidScenes()) {
    if (scene.contacts.size() != 1) continue;
    const SolidContact& truth = scene.contacts.front();
    if (truth.force_n.norm() > 0.01 * truth.normal_force_n) continue;
    ++hugs;
    for (const How& how : {How{"exact"}, How{"hug", 0.1}}) {
      SCOPED_TRACE(scene.name + " " + how.name);
      const Shown shown = Show(scene, how);
      const LinkState state = SolveMarkers(model, estimator, shown.pressure, shown.shape);
      ASSERT_EQ(state.contacts.size(), 1u);
      const Contact& contact = state.contacts.front();
      EXPECT_TRUE(contact.is_hug);
      EXPECT_NEAR(contact.normal_force_n, truth.normal_force_n, 0.12 * truth.normal_force_n);
      EXPECT_LT(contact.force_n.norm(), 0.05 * truth.normal_force_n);
      EXPECT_LT((contact.center_mm - truth.center_mm).norm(), 4);
    }
  }
  EXPECT_GE(hugs, 6);
}

// Whatever was shown before, the same markers give the same forces: scenes in random order, every third with
// most of its markers gone, against an estimator that knows nothing.
TEST(SolidsTest, ColdIsWarm) {
  const std::vector<SolidScene> scenes = ReadSolidScenes();
  ASSERT_FALSE(scenes.empty());
  std::mt19937 random(7);
  const LinkModel model = SolidSkin();
  StateEstimator warm(model, {}), cold(model, {});
  int compared = 0, alike = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const SolidScene& scene = scenes[random() % scenes.size()];
    const bool blind = frame % 3 == 1;
    const Shown shown = Show(scene, {"walk", 0.1, blind ? 0.7 : 0.0});
    const LinkState with = SolveMarkers(model, warm, shown.pressure, shown.shape);
    if (blind) continue;
    cold.Restart();
    const LinkState without = SolveMarkers(model, cold, shown.pressure, shown.shape);
    if (!without.forces.converged) continue;
    ++compared;
    bool same = with.forces.converged && with.contacts.size() == without.contacts.size();
    for (size_t i = 0; same && i < with.contacts.size(); ++i) {
      double nearest = 1e9;
      const Contact& a = with.contacts[i];
      for (const Contact& b : without.contacts) nearest = std::min(nearest, (a.force_n - b.force_n).norm());
      same = a.force_covariance_n2 && nearest < 0.2 * std::sqrt(a.force_covariance_n2->trace());
    }
    alike += same;
    if (!same) std::printf("  %s differs from what was before\n", scene.name.c_str());
  }
  std::printf("%d of %d alike\n", alike, compared);
  EXPECT_GE(compared, 30);
  EXPECT_GE(alike, 0.9 * compared);
}

}  // namespace
}  // namespace taclink
