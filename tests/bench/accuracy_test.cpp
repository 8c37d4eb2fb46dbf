#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "bench/force/accuracy_report.h"
#include "sensing/core/known_loads.h"
#include "sensing/model/model_file.h"
#include "tests/support/temporary_folder.h"

namespace taclink {
namespace {

LinkModel Cylinder() {
  return LoadLinkModel("cylinder").value();
}

// The nearest that a body comes to the undeformed outer surface.
double LeastGap(const LinkModel& model, const RigidBody& body) {
  double least = 1e9;
  for (int i = 0; i < 720; ++i) {
    for (double z = 0; z <= model.length_mm; z += 0.5)
      least = std::min(least, GapOf(body, model.PointAtDepth(i * kPi / 360, z, 0)).distance_mm);
  }
  return least;
}

TEST(AccuracyScenes, AreManyAndOfEveryKind) {
  const auto paths = PressPaths(Cylinder(), {0, 0.0005, 0.001, 0.0015});
  std::set<std::string> names;
  std::set<PressKind> kinds;
  int scenes = 0;
  for (const PressPath& path : paths) {
    names.insert(path.name);
    kinds.insert(path.kind);
    scenes += path.scenes();
  }
  EXPECT_EQ(names.size(), paths.size());
  EXPECT_EQ(kinds.size(), static_cast<size_t>(kPressKindCount));
  EXPECT_GE(scenes, 60);
}

TEST(AccuracyScenes, SomeAreOfSkinsWithWeight) {
  LinkModel model = Cylinder();
  const auto held = [&] {
    const auto paths = PressPaths(model, {0, 0.0005, 0.001, 0.0015});
    return std::count_if(paths.begin(), paths.end(), [](const PressPath& p) { return !p.attitude.empty(); });
  };
  EXPECT_EQ(held(), 8);
  model.density_kg_m3 = 0;
  EXPECT_EQ(held(), 0);
}

TEST(AccuracyScenes, BodiesStartWhereTheyTouchTheUndeformedSkin) {
  for (const char* name : {"cylinder", "barrel"}) {
    const LinkModel model = LoadLinkModel(name).value();
    for (const PressPath& path : PressPaths(model, {0})) {
      for (const PressBody& body : path.bodies) {
        EXPECT_NEAR(LeastGap(model, body.touching), 0, 0.06) << path.name;
        EXPECT_LT(LeastGap(model, Moved(body.touching, body.Offset(1, 0))), -0.9) << path.name;
        EXPECT_NEAR(body.into.dot(body.along), 0, 1e-12);
      }
    }
  }
}

// A truth of two contacts on opposite sides and what an estimator makes of it.
class AccuracyScoreTest : public ::testing::Test {
 protected:
  AccuracyScoreTest() {
    truth_.displacements_mm.assign(static_cast<size_t>(model_.markers.count()), Vec3::Zero());
    truth_.contacts = {{Vec3(-1, 0, 0), Vec3(40, 0, 100), {}},
                       {Vec3(0.5, 0, 0), Vec3(-40, 0, 100), {Vec3(-40, 0, 140)}}};
    forces_.forces_n.assign(truth_.displacements_mm.size(), Vec3::Zero());
    found_.resize(2);
    for (size_t i = 0; i < 2; ++i) {
      found_[i].force_n = truth_.contacts[i].force_n;
      found_[i].center_mm = truth_.contacts[i].center_mm;
    }
  }
  FrameScore Score() const { return ScoreContacts(model_, truth_, forces_, found_); }

  const LinkModel model_ = Cylinder();
  TrueStage truth_;
  NodalForces forces_;
  std::vector<Contact> found_;
};

TEST_F(AccuracyScoreTest, TheTruthIsWithinAllBounds) {
  const FrameScore score = Score();
  ASSERT_EQ(score.contacts.size(), 2U);
  for (const ContactScore& contact : score.contacts) {
    EXPECT_EQ(contact.vector_error_n, 0);
    EXPECT_EQ(contact.center_mm, 0);
    EXPECT_LT(contact.direction_deg, 1e-5);
  }
  EXPECT_EQ(score.phantom_n, 0);
  EXPECT_TRUE(score.Within() && score.VectorWithin());
}

TEST_F(AccuracyScoreTest, SizeDirectionAndCentreCountApart) {
  found_[0].force_n = Vec3(0, 0, 1);
  FrameScore score = Score();
  EXPECT_NEAR(score.contacts[0].direction_deg, 90, 1e-9);
  EXPECT_NEAR(score.contacts[0].size_error_n, 0, 1e-12);
  EXPECT_NEAR(score.contacts[0].vector_error_n, std::sqrt(2.0), 1e-12);
  EXPECT_TRUE(score.Within());
  EXPECT_FALSE(score.VectorWithin());
  found_[0].force_n = Vec3(-1.11, 0, 0);
  EXPECT_FALSE(Score().Within());
  found_[0].force_n = Vec3(-1.09, 0, 0);
  EXPECT_TRUE(Score().Within());
  found_[0].center_mm.z() += 4.1;
  EXPECT_FALSE(Score().Within());
}

TEST_F(AccuracyScoreTest, PhantomsAreFarFromAllThatTouches) {
  Contact more;
  more.force_n = Vec3(0.04, 0, 0);
  more.center_mm = Vec3(-40, 0, 160);  // 20 mm from a touched point: a part of the second contact
  found_.push_back(more);
  EXPECT_EQ(Score().phantom_n, 0);
  EXPECT_NEAR(Score().contacts[1].size_error_n, 0.04, 1e-12);
  found_.back().center_mm.z() = 166;
  EXPECT_NEAR(Score().phantom_n, 0.04, 1e-12);
  EXPECT_FALSE(Score().Within());
}

TEST_F(AccuracyScoreTest, AMissedContactHasItsWholeForceWrong) {
  found_.pop_back();
  const FrameScore score = Score();
  EXPECT_TRUE(score.contacts[1].missed);
  EXPECT_NEAR(score.contacts[1].size_error_n, 0.5, 1e-12);
  EXPECT_FALSE(score.Within());
}

TEST_F(AccuracyScoreTest, ForcesOnFarMarkersAreStray) {
  const auto near = static_cast<size_t>(model_.MarkerIndex(0, 4)), far = static_cast<size_t>(6);
  forces_.loaded = {static_cast<int>(near), static_cast<int>(far)};
  forces_.forces_n[near] = Vec3(-1, 0, 0);
  forces_.forces_n[far] = Vec3(0, -0.2, 0);
  EXPECT_NEAR(Score().stray_n, 0.2, 1e-12);
}

PressPath ShortPath(const LinkModel& model) {
  PressPath path = MakePressPath(model, PressKind::kSphereMarker, 0.001);
  path.stages = {{2}, {4}};
  return path;
}

TEST(AccuracyTruth, IsInBalanceAndAtRestWithoutLoads) {
  const LinkModel model = Cylinder();
  const PathTruth rest = SolvePath(model, MakePressPath(model, PressKind::kRest, 0), 1);
  EXPECT_EQ(rest.failure, "");
  for (const Vec3& u : rest.inflated.displacements_mm) EXPECT_LT(u.norm(), 1e-9);
  const PathTruth pressed = SolvePath(model, ShortPath(model), 1);
  ASSERT_EQ(pressed.failure, "");
  ASSERT_EQ(pressed.stages.size(), 2U);
  const PressBody& body = pressed.path.bodies[0];
  double before = 0;
  for (const TrueStage& stage : pressed.stages) {
    const BodyContact& contact = stage.contacts.at(0);
    EXPECT_GT(contact.force_n.dot(body.into), before);
    before = contact.force_n.dot(body.into);
    EXPECT_LT(
        GapOf(Moved(body.touching, body.Offset(stage.stage.depth_mm, 0)), contact.center_mm).distance_mm,
        0.1);
  }
}

TEST(AccuracyTruth, OfASkinWithWeightCountsFromItsBaseline) {
  const LinkModel model = Cylinder();
  const auto held = [&](const std::string& attitude, const Vec3& down) {
    return WithWeight(MakePressPath(model, PressKind::kRest, 0), attitude, kStandardGravity * down);
  };
  const auto sag_mm = [&](const PathTruth& truth) {
    SkinShape shape;
    MakeShape(model, truth.inflated, 0, 1, shape);
    double sag = 0;
    for (const auto& measured : shape.measured) sag = std::max(sag, measured.displacement_mm.norm());
    return sag;
  };
  const PathTruth upright = SolvePath(model, held("upright", -Vec3::UnitZ()), 1);
  const PathTruth lying = SolvePath(model, held("lying", -Vec3::UnitY()), 1);
  ASSERT_EQ(upright.failure + lying.failure, "");
  EXPECT_LT(sag_mm(upright), 1e-9);
  EXPECT_NEAR(sag_mm(lying), 3.6, 0.6);  // as three-dimensional solids
  const std::string key = TruthKey(model, lying.path, 1), text = TruthText(lying, key);
  PathTruth read;
  ASSERT_TRUE(ReadTruth(text, key, read));
  EXPECT_EQ(TruthText(read, key), text);
  LinkModel heavier = model;
  heavier.density_kg_m3 *= 1.01;
  EXPECT_NE(TruthKey(heavier, lying.path, 1), key);
}

TEST(AccuracyBench, KnowsTheSpecificForceOfNowRoughlyAndOfTheBaselineExactly) {
  const PressPath path = MakePressPath(Cylinder(), PressKind::kRest, 0.001);
  const LoadsPair weightless = LoadsOf(path, 1e-5, 1);
  EXPECT_EQ(weightless.now.Loads(), (KnownLoads{0.001, Vec3::Zero()}));
  EXPECT_TRUE(weightless.now.specific_force_covariance.isZero(0));
  const Vec3 lying(0, -kStandardGravity, 0);
  const LoadsPair held = LoadsOf(WithWeight(path, "lying", lying), 1e-5, 1);
  EXPECT_EQ(held.baseline.Loads(), (KnownLoads{0, Vec3(0, 0, -kStandardGravity)}));
  EXPECT_TRUE(held.baseline.specific_force_covariance.isZero(0));
  const double off = (held.now.specific_force_mps2 - lying).norm();
  EXPECT_GT(off, 0);
  EXPECT_LT(off, 1);
  EXPECT_NEAR(held.now.specific_force_covariance(0, 0), 0.04, 1e-12);
}

TEST(AccuracyTruth, IsKeptAsItWas) {
  const LinkModel model = Cylinder();
  const PathTruth truth = SolvePath(model, ShortPath(model), 1);
  const std::string key = TruthKey(model, truth.path, 1), text = TruthText(truth, key);
  PathTruth read;
  ASSERT_TRUE(ReadTruth(text, key, read));
  EXPECT_EQ(TruthText(read, key), text);
  EXPECT_FALSE(ReadTruth(text, TruthKey(model, truth.path, 2), read));
  EXPECT_FALSE(ReadTruth(text.substr(0, text.size() / 2), key, read));
  LinkModel stiffer = model;
  stiffer.material.youngs_modulus_mpa *= 1.01;
  EXPECT_NE(TruthKey(stiffer, truth.path, 1), key);
}

TEST(AccuracyTruth, TheFolderIsUsed) {
  const LinkModel model = Cylinder();
  const TemporaryFolder made;
  const std::string folder = made / "truth";
  const PressPath path = MakePressPath(model, PressKind::kRest, 0.0005);
  const auto first = CachedPath(model, path, 1, folder);
  ASSERT_TRUE(first.ok());
  const auto again = CachedPath(model, path, 1, folder);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(first->cpu_s, again->cpu_s);  // the second was not solved
}

TEST(AccuracyBench, NoiseIsOfTheSaidCovariance) {
  const LinkModel model = Cylinder();
  TrueStage truth;
  truth.displacements_mm.assign(static_cast<size_t>(model.markers.count()), Vec3(1, 2, 3));
  SkinShape shape;
  MakeShape(model, truth, 0.1, 5, shape);
  Vec3 squares = Vec3::Zero();
  double normalised = 0;
  for (size_t m = 0; m < shape.measured.size(); ++m) {
    const Vec3 error = shape.measured[m].displacement_mm - truth.displacements_mm[m];
    squares += error.cwiseAbs2();
    normalised += error.dot(shape.measured[m].information_per_mm2 * error);
  }
  const auto count = static_cast<double>(shape.measured.size());
  EXPECT_NEAR(std::sqrt(squares.x() / count), 0.1, 0.015);
  EXPECT_NEAR(std::sqrt(squares.z() / count), 0.3, 0.045);
  EXPECT_NEAR(normalised / count, 3, 0.4);
  MakeShape(model, truth, 0, 5, shape);
  for (const auto& measured : shape.measured) EXPECT_EQ(measured.displacement_mm, Vec3(1, 2, 3));
}

TEST(AccuracyBench, ResultsDoNotDependOnJobs) {
  const LinkModel model = Cylinder();
  std::vector<PathTruth> truths = {SolvePath(model, MakePressPath(model, PressKind::kRest, 0), 1),
                                   SolvePath(model, ShortPath(model), 1)};
  AccuracyOptions options{.methods = {{ForceModel::kLinear, 1}}, .noises_mm = {0, 0.05}, .progress = {}};
  const auto alone = RunAccuracyBench(model, truths, options);
  options.jobs = 2;
  const auto beside = RunAccuracyBench(model, truths, options);
  ASSERT_EQ(alone.size(), 2U);
  for (size_t i = 0; i < alone.size(); ++i) {
    const AccuracySummary a = Summarize(alone[i]), b = Summarize(beside[i]);
    EXPECT_EQ(a.size_n, b.size_n);
    EXPECT_EQ(a.center_mm, b.center_mm);
    EXPECT_EQ(a.frames, alone[i].noise_mm > 0 ? 12 : 6);
    EXPECT_EQ(a.loaded_frames, alone[i].noise_mm > 0 ? 8 : 4);
    EXPECT_GT(a.size_n, 0);
    EXPECT_GT(alone[i].memory_mb, 0);
    EXPECT_FALSE(alone[i].rest_cpu_ms.empty());
  }
}

TEST(AccuracyReport, TellsWhoAnswered) {
  PathTruth path;
  path.path.kind = PressKind::kBar;
  TrueStage stage;
  FrameScore frame;
  frame.contacts = {{.true_n = 1, .size_error_n = 0.25, .vector_error_n = 0.5, .center_mm = 2}};
  AccuracyOutcome outcome;
  outcome.method = {ForceModel::kLinear, 2};
  outcome.model = "can";
  outcome.noise_mm = 0.05;
  outcome.scenes = {{&path, &stage, {frame}}};
  outcome.answered = {{"linear", 3}};
  outcome.cpu_ms = {0.5F};
  AccuracyOutcome other = outcome;
  other.method.model = ForceModel::kNonlinear;
  other.answered = {{"nonlinear", 2}, {"pressurised", 1}};
  const auto tables = AccuracyTables({outcome, other}, 0.05);
  const std::string first = Markdown(tables.front()), costs = Markdown(tables.at(1));
  EXPECT_THAT(first, ::testing::HasSubstr("| linear | can | 2 | 0.250 | 25.0 | 25.0 | 50.0 |"));
  EXPECT_THAT(costs, ::testing::HasSubstr("nonlinear 2, pressurised 1 |"));
  EXPECT_THAT(tables.back().title, ::testing::HasSubstr("By pressure"));
  PathTruth held = path;
  held.path.attitude = "lying";
  outcome.scenes.push_back({&held, &stage, {frame}});
  const ReportTable by_attitude = AccuracyTables({outcome}, 0.05).back();
  EXPECT_EQ(by_attitude.header.back(), "lying");
  EXPECT_THAT(Markdown(by_attitude), ::testing::HasSubstr("weightless"));
  outcome.scenes.pop_back();
  const std::string svg = AccuracyPlot({outcome, other}, 0.05);
  EXPECT_THAT(svg, ::testing::HasSubstr(">linear 2<"));
  EXPECT_THAT(svg, ::testing::HasSubstr(">nonlinear 2<"));
}

TEST(AccuracyReport, FailedScenesAreListed) {
  const LinkModel model = Cylinder();
  PathTruth failed;
  failed.path = MakePressPath(model, PressKind::kPinch, 0);
  failed.stages.resize(1);
  failed.failure = "before depth 10 mm: stopped";
  PathTruth good;
  good.path = MakePressPath(model, PressKind::kBar, 0);
  good.stages.resize(2);
  const ReportTable table = FailedPaths({failed, good});
  ASSERT_EQ(table.rows.size(), 1U);
  EXPECT_EQ(table.rows[0][2], "2");
}

}  // namespace
}  // namespace taclink
