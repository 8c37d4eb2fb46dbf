#include "sensing/shell/linear_shell.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

// Compliance of one node, mm/N: columns are its displacement under a unit force along X, Y, Z.
Mat3 NodeCompliance(const LinearShell& shell, int node) {
  Mat3 compliance;
  for (int axis = 0; axis < 3; ++axis) {
    const NodalLoad load{node, Vec3::Unit(axis)};
    compliance.col(axis) = shell.Solve({&load, 1}).translations_mm[static_cast<size_t>(node)];
  }
  return compliance;
}

// The thesis' material, 0.1 MPa, whatever is shipped.
LinkModel Cylinder() {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.material.youngs_modulus_mpa = 0.1;
  return model;
}

class CylinderShell : public ::testing::Test {
 protected:
  const LinkModel model_ = Cylinder();
  const LinearShell shell_{model_, 1};
  const int node_127_ = shell_.mesh().NodeOfMarker(model_, model_.MarkerIndex(6, 4));
};

// The thesis' (6.3): 1 mm along X, Y and Z together; the numbers are those of a locking-free Mindlin element
// on the same mesh, without residual bending flexibility (mitc4.md), which makes the skin a tenth softer
// around.
TEST_F(CylinderShell, ResponseOfNode127) {
  const Vec3 force = NodeCompliance(shell_, node_127_).inverse() * Vec3(1, 1, 1);
  EXPECT_NEAR(force.x(), 0.084, 0.006);
  EXPECT_NEAR(force.y(), 0.028, 0.003);
  EXPECT_NEAR(force.z(), 0.294, 0.015);
}

// The closed solution of a long thin cylinder, clamped at both ends, pressure on its mid-surface: the ends
// are held in over a length of 1 / beta each, so that the axial force that they exert is less than that of
// plane strain.
TEST_F(CylinderShell, InflationAtMidLength) {
  const auto& mesh = shell_.mesh();
  constexpr double kPressure = 1.5e-3;
  const Vec3 p =
      kPressure * shell_.PerPressure().translations_mm[static_cast<size_t>(mesh.Node(6, mesh.rows / 2))];
  const double t = model_.thickness_mm, r = 36.5 + t / 2, nu = model_.material.poisson_ratio;
  const double beta = std::pow(3 * (1 - nu * nu), 0.25) / std::sqrt(r * t);
  const double held = 1 - 2 / (beta * model_.length_mm), poisson = nu * nu / (1 - nu * nu);
  const double closed = kPressure * r * r / (model_.material.youngs_modulus_mpa * t) / (1 + held * poisson);
  EXPECT_NEAR(p.y() / closed, 1, 0.005);
  EXPECT_NEAR(p.x(), 0, 1e-6);
}

TEST_F(CylinderShell, ComplianceIsSymmetric) {
  const auto& mesh = shell_.mesh();
  const NodalLoad a{mesh.Node(3, 4), Vec3(0.1, -0.2, 0.3)}, b{mesh.Node(20, 8), Vec3(-0.3, 0.1, 0.2)};
  const double a_on_b = b.force_n.dot(shell_.Solve({&a, 1}).translations_mm[static_cast<size_t>(b.node)]);
  const double b_on_a = a.force_n.dot(shell_.Solve({&b, 1}).translations_mm[static_cast<size_t>(a.node)]);
  EXPECT_NEAR(a_on_b, b_on_a, 1e-10 * (std::abs(a_on_b) + 1));
}

TEST_F(CylinderShell, ClampedNodesStay) {
  const NodalLoad load{node_127_, Vec3(0, -0.2, 0)};
  const auto u = shell_.Solve({&load, 1});
  for (int column = 0; column < shell_.mesh().columns; ++column) {
    EXPECT_EQ(u.translations_mm[static_cast<size_t>(shell_.mesh().Node(column, 0))].norm(), 0);
    EXPECT_EQ(
        u.translations_mm[static_cast<size_t>(shell_.mesh().Node(column, shell_.mesh().rows - 1))].norm(), 0);
  }
}

TEST_F(CylinderShell, TurningTheLoadTurnsTheResponse) {
  const auto& mesh = shell_.mesh();
  const Mat3 turn(Eigen::AngleAxisd(model_.markers.path_pitch_rad(), Vec3::UnitZ()));
  const NodalLoad load{mesh.Node(3, 4), Vec3(0.1, -0.2, 0.3)}, turned{mesh.Node(4, 4), turn * load.force_n};
  const auto u = shell_.Solve({&load, 1}), v = shell_.Solve({&turned, 1});
  for (int node = 0; node < mesh.node_count(); ++node) {
    const Vec3 expected = turn * u.translations_mm[static_cast<size_t>(node)];
    const Vec3 found =
        v.translations_mm[static_cast<size_t>(mesh.Node(mesh.Column(node) + 1, mesh.Row(node)))];
    EXPECT_LT((expected - found).norm(), 1e-9);
  }
}

TEST(LinearShell, RefinementConvergesOnInflation) {
  const LinkModel model = LoadLinkModel("barrel").value();
  std::vector<double> radial;
  for (const int refinement : {2, 3, 4}) {
    const LinearShell shell(model, refinement);
    const int node = shell.mesh().NodeOfMarker(model, model.MarkerIndex(0, 8));
    radial.push_back(shell.PerPressure().translations_mm[static_cast<size_t>(node)].x());
  }
  EXPECT_LT(std::abs(radial[2] - radial[1]), std::abs(radial[1] - radial[0]));
  EXPECT_NEAR(radial[2] / radial[1], 1, 0.02);
}

// Few markers around must not mean few elements: the same skin, with 4 and with 24 paths.
TEST(LinearShell, CoarseMarkerGridsAreRefined) {
  LinkModel model = LoadLinkModel("cylinder").value();
  const auto stiffness = [&model] {
    const LinearShell shell(model, 1);
    return 1 / NodeCompliance(shell, shell.mesh().NodeOfMarker(model, model.MarkerIndex(0, 4)))(0, 0);
  };
  const double fine = stiffness();
  model.markers.paths = 4;
  EXPECT_NEAR(stiffness() / fine, 1, 0.25);
}

}  // namespace
}  // namespace taclink
