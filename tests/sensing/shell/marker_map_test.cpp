#include "sensing/shell/marker_map.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "sensing/model/model_file.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {
namespace {

class MarkerMapTest : public ::testing::Test {
 protected:
  // Every free degree of freedom drawn at random; rotations as if the wall's surfaces moved as far.
  ShellState Disturbed(double size_mm) const {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    Eigen::VectorXd step(shell_.dof_count());
    for (int node = 0; node < shell_.node_count(); ++node) {
      for (int c = 0; c < 5; ++c) {
        if (shell_.Dof(node, c) >= 0)
          step[shell_.Dof(node, c)] = size_mm * normal(random) / (c < 3 ? 1 : model_.thickness_mm);
      }
    }
    ShellState state = shell_.Rest();
    shell_.Step(step, state);
    return state;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  // Unlike around and along, so that a mix-up of columns and rows shows.
  const ShellMesh mesh_ = MakeShellMesh(model_, MeshRefinement{.around = 2, .along = 1});
  const NonlinearShell shell_{SkinSurface(mesh_), model_.material};
  const MarkerMap map_{model_, mesh_};
};

TEST_F(MarkerMapTest, SlackSkinHasItsMarkersAtRest) {
  const ShellState rest = shell_.Rest();
  Eigen::VectorXd stacked;
  map_.Displacements(rest, stacked);
  EXPECT_EQ(stacked.norm(), 0);
  ASSERT_EQ(map_.markers(), model_.markers.count());
  for (int m = 0; m < map_.markers(); ++m) {
    EXPECT_LT((map_.Position(rest.mids_mm, rest.directors, m) - model_.RestMarker(m)).norm(), 1e-9) << m;
    EXPECT_NEAR(map_.HalfThickness(rest.mids_mm, m), model_.thickness_mm / 2, 1e-12) << m;
  }
}

// Along every degree of freedom, by central differences; the matrix is written twice, as it is in use.
TEST_F(MarkerMapTest, JacobianIsTheDerivativeOfTheDisplacements) {
  const ShellState state = Disturbed(0.5);
  MarkerMap::Jacobian jacobian = map_.MakeJacobian(shell_);
  map_.WriteJacobian(shell_, shell_.Rest(), jacobian);
  map_.WriteJacobian(shell_, state, jacobian);
  const Eigen::MatrixXd dense(jacobian);
  constexpr double kStep = 1e-4;
  Eigen::MatrixXd differences(3 * map_.markers(), shell_.dof_count());
  Eigen::VectorXd left, right;
  for (int dof = 0; dof < shell_.dof_count(); ++dof) {
    ShellState ahead = state, behind = state;
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(shell_.dof_count(), dof);
    shell_.Step(kStep * unit, ahead);
    shell_.Step(-kStep * unit, behind);
    map_.Displacements(ahead, right);
    map_.Displacements(behind, left);
    differences.col(dof) = (right - left) / (2 * kStep);
  }
  EXPECT_LT((dense - differences).norm(), 1e-6 * dense.norm());
  // The columns of the wall's thickness are small beside those of the node itself; they count on their own.
  const auto thickness = [&](const Eigen::MatrixXd& all) {
    Eigen::MatrixXd part = all;
    for (int m = 0; m < map_.markers(); ++m) {
      for (int c = 0; c < 5; ++c)
        part.block<3, 1>(3 * m, shell_.Dof(map_.node(m), c)) -= map_.OwnJacobian(state, m).col(c);
    }
    return part;
  };
  EXPECT_LT((thickness(dense) - thickness(differences)).norm(), 1e-6 * thickness(dense).norm());
}

TEST_F(MarkerMapTest, RigidMotionLeavesDistancesUnchanged) {
  const Eigen::AngleAxisd turn(2.1, Vec3(1, -2, 0.5).normalized());
  const Vec3 shift(3, -20, 8);
  const ShellState before = Disturbed(0.5);
  ShellState after = before;
  for (Vec3& p : after.mids_mm) p = turn * p + shift;
  for (Vec3& d : after.directors) d = turn * d;
  for (Vec3& t : after.tangents) t = turn * t;
  for (int m = 0; m < map_.markers(); ++m) {
    const Vec3 expected = turn * map_.Position(before.mids_mm, before.directors, m) + shift;
    EXPECT_LT((map_.Position(after.mids_mm, after.directors, m) - expected).norm(), 1e-10) << m;
    EXPECT_NEAR(map_.HalfThickness(after.mids_mm, m), map_.HalfThickness(before.mids_mm, m), 1e-12) << m;
  }
}

// Three-dimensional bricks of another program at 1 kPa, neo-Hookean, 0.1 MPa
// (tests/accuracy/calculix/results.csv, tube-inflation): the inner wall grows by 4.2317 mm at z = 87.7
// and 4.2320 mm in the middle, the mid-surface by 4.067 mm, the wall is 3.18 mm thick. Markers are on the
// inner wall; without the wall's thinning they would grow with the mid-surface.
TEST_F(MarkerMapTest, InflationIsThatOfSolids) {
  LinkModel rubber = model_;
  rubber.material = {.youngs_modulus_mpa = 0.1, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};
  PressedSkin skin(rubber, {.refinement = 2});
  ASSERT_TRUE(skin.Inflate(1e-3).ok());
  const MarkerMap map(rubber, skin.mesh());
  for (const int path : {0, 7}) {
    for (const int ring : {4, 5}) {  // z of 90 and 108
      const int marker = rubber.MarkerIndex(path, ring);
      const double growth = skin.Marker(marker).head<2>().norm() - rubber.RestMarker(marker).head<2>().norm();
      EXPECT_NEAR(growth / 4.232, 1, 0.02) << "path " << path << " ring " << ring;
      EXPECT_NEAR(2 * map.HalfThickness(skin.state().mids_mm, marker), 3.18, 0.02);
    }
  }
}

}  // namespace
}  // namespace taclink
