#include "bench/vision/vision_bench.h"

#include <gtest/gtest.h>

#include "bench/thesis/thesis_method.h"
#include "bench/vision/pipeline_method.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {
namespace {

const VisionMethodKind kTracked = {
    "tracked", "", [](const LinkModel& model) { return MakePipelineMethod(model, PipelineVariant::kWhole); }};
const VisionMethodKind kThesis = {"thesis", "", MakeThesisMethod};

class VisionBenchTest : public ::testing::Test {
 protected:
  std::vector<SceneOutcome> Run(const std::vector<std::string>& names,
                                const std::vector<VisionMethodKind>& methods, int jobs) {
    std::vector<EvaluationScene> scenes;
    for (const std::string& name : names) scenes.push_back(GenerateScene(models_, name, 1).value());
    const auto outcomes = RunVisionBench(
        models_, scenes,
        {.methods = methods, .truth_refinement = 1, .jobs = jobs, .progress = {}, .on_frame = {}});
    EXPECT_TRUE(outcomes.ok()) << outcomes.error().message;
    return *outcomes;
  }
  const std::vector<LinkModel> models_ = {LoadLinkModel("cylinder").value()};
};

void ExpectSame(const SceneOutcome& a, const SceneOutcome& b) {
  ASSERT_EQ(a.name, b.name);
  for (size_t i = 0; i < a.scores.size(); ++i) {
    EXPECT_EQ(a.scores[i].position[2].squares, b.scores[i].position[2].squares);
    EXPECT_EQ(a.scores[i].nees, b.scores[i].nees);
    EXPECT_EQ(a.scores[i].labels[0].labelled, b.scores[i].labels[0].labelled);
  }
}

TEST_F(VisionBenchTest, ResultsDoNotDependOnWhoPlaysBeside) {
  const std::vector<std::string> names = {"one-dent-cylinder-1", "rest-cylinder-1", "dirt-cylinder-2"};
  const auto alone = Run(names, {kThesis}, 1), beside = Run(names, {kThesis}, 2);
  for (size_t i = 0; i < names.size(); ++i) ExpectSame(alone[i], beside[i]);
  EXPECT_TRUE(alone[1].scores[0].nees[0].empty());  // the thesis' method says no covariances
}

// A pipeline that has played another scene before does as a new one.
TEST_F(VisionBenchTest, ResultsDoNotDependOnWhatWasPlayedBefore) {
  const auto both = Run({"one-dent-cylinder-1", "rest-cylinder-1"}, {kTracked}, 1);
  ExpectSame(both[1], Run({"rest-cylinder-1"}, {kTracked}, 1)[0]);
  const VisionScore& rest = both[1].scores[0];
  EXPECT_EQ(rest.frames, both[1].frames - kRestFrames);
  EXPECT_EQ(rest.measured, rest.frames);
  EXPECT_EQ(rest.labels[0].wrong + rest.labels[1].wrong, 0);
  EXPECT_LT(rest.position[2].Rms(ErrorAxis::k3d), 0.8);
  EXPECT_GT(rest.position[2].Rms(ErrorAxis::k3d), 0);
  EXPECT_EQ(rest.times.vision.size(), static_cast<size_t>(rest.frames));
  EXPECT_FALSE(rest.nees[0].empty());
}

TEST_F(VisionBenchTest, ASceneWithoutItsModelIsRefused) {
  EvaluationScene scene = GenerateScene(models_, "rest-cylinder-1", 1).value();
  scene.model = "cube";
  const auto outcomes =
      RunVisionBench(models_, {scene}, {.methods = {kThesis}, .progress = {}, .on_frame = {}});
  ASSERT_FALSE(outcomes.ok());
  EXPECT_NE(outcomes.error().message.find("cube"), std::string::npos);
}

TEST(TruthRefinement, IsFinerThanAnyEstimate) {
  for (const char* name : {"cylinder", "barrel"}) {
    const LinkModel model = LoadLinkModel(name).value();
    EXPECT_GT(MakeShellMesh(model, kVisionTruthRefinement).refinement, MakeShellMesh(model, 2).refinement)
        << name;
  }
}

}  // namespace
}  // namespace taclink
