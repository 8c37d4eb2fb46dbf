#include "sensing/force/pressurised_tangents.h"

#include <gtest/gtest.h>

#include <limits>

#include "sensing/mechanics/pressed_skin.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class PressurisedTangentsTest : public testing::Test {
 protected:
  PressurisedTangents Make() const {
    return PressurisedTangents(model_, 1, MakeLoadSites(model_, MakeShellMesh(model_, 1)));
  }

  LinkModel model_ = LoadLinkModel("cylinder").value();
};

TEST_F(PressurisedTangentsTest, InflationIsThatOfTheForwardSolverAtAnyPressure) {
  PressurisedTangents tangents = Make();
  for (const double pressure_mpa : {-0.05e-3, -1e-6, 0.01e-3, 0.123e-3, 0.6e-3, 1.1e-3, 1.5e-3, 2.3e-3}) {
    PressedSkin skin(model_, {.refinement = 1});
    ASSERT_TRUE(skin.Inflate(pressure_mpa).ok());
    const SkinTangent* tangent = tangents.At(pressure_mpa);
    ASSERT_NE(tangent, nullptr) << pressure_mpa;
    Eigen::VectorXd exact_mm;
    MarkerDisplacements(model_, skin.mesh(), skin.state(), exact_mm);
    const Eigen::VectorXd told_mm =
        tangent->offset_mm + (pressure_mpa - tangent->pressure_mpa) * tangent->per_pressure;
    EXPECT_LT((told_mm - exact_mm).cwiseAbs().maxCoeff(), 0.01) << pressure_mpa;
    EXPECT_LT((tangents.Inflated().mids_mm[200] - skin.state().mids_mm[200]).norm(), 0.1) << pressure_mpa;
  }
}

TEST_F(PressurisedTangentsTest, AnswerToALoadIsThatOfTheForwardSolver) {
  constexpr double kPressureMpa = 0.73e-3, kLoadN = 1e-4;
  PressurisedTangents tangents = Make();
  const SkinTangent* tangent = tangents.At(kPressureMpa);
  ASSERT_NE(tangent, nullptr);
  PressedSkin skin(model_, {.refinement = 1});
  ASSERT_TRUE(skin.Inflate(kPressureMpa).ok());
  const int site = 4 * model_.markers.paths;
  const LoadSites sites = MakeLoadSites(model_, skin.mesh());
  const FollowerPressure pressure(model_.thickness_mm, kPressureMpa);
  const ElementLoad* loads[] = {&pressure};
  Eigen::VectorXd force = Eigen::VectorXd::Zero(skin.shell().dof_count());
  const auto s = static_cast<size_t>(site);
  force.segment<3>(skin.shell().Dof(sites.nodes[s], 0)) = kLoadN * sites.frames[s].col(0);
  ShellState pushed = skin.state();
  EquilibriumSolver solver(skin.shell(), {.tolerance_n = 1e-9});
  ASSERT_TRUE(solver.Solve(loads, force, pushed).ok());
  Eigen::VectorXd before_mm, after_mm;
  MarkerDisplacements(model_, skin.mesh(), skin.state(), before_mm);
  MarkerDisplacements(model_, skin.mesh(), pushed, after_mm);
  const Eigen::VectorXd exact = (after_mm - before_mm) / kLoadN;
  EXPECT_LT((tangent->inward_mm_n.col(site).cast<double>() - exact).norm(), 0.03 * exact.norm());
}

TEST_F(PressurisedTangentsTest, NothingIsToldWhereTheSkinBuckles) {
  PressurisedTangents tangents = Make();
  EXPECT_EQ(tangents.At(-0.3e-3), nullptr);
  EXPECT_EQ(tangents.At(-1), nullptr);
  EXPECT_EQ(tangents.At(1e9), nullptr);
  EXPECT_EQ(tangents.At(std::numeric_limits<double>::quiet_NaN()), nullptr);
  EXPECT_NE(tangents.At(0.5e-3), nullptr) << "a refusal must not spoil what follows";
}

}  // namespace
}  // namespace taclink
