#include "sensing/shell/mitc4.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

namespace taclink {
namespace {

constexpr double kThickness = 3.5;
constexpr Material kMaterial{.youngs_modulus_mpa = 0.1, .poisson_ratio = 0.4};

ShellCorner Corner(const Vec3& p, const Vec3& director) {
  return {p, director, TangentsOf(director)};
}

// A piece of a warped cylinder-like surface with differing directors.
std::array<ShellCorner, 4> CurvedElement() {
  return {Corner({38, 0, 0}, Vec3(1, 0.02, 0.1).normalized()),
          Corner({36.9, 9.9, 1}, Vec3(0.97, 0.26, 0).normalized()),
          Corner({37.5, 10.2, 18}, Vec3(0.95, 0.27, -0.1).normalized()),
          Corner({38.6, -0.3, 17}, Vec3(1, -0.03, 0).normalized())};
}

ElementVector RigidMotion(const std::array<ShellCorner, 4>& corners, const Vec3& translation,
                          const Vec3& rotation) {
  ElementVector u;
  for (size_t i = 0; i < 4; ++i) {
    const auto at = static_cast<Eigen::Index>(i) * kDofsPerNode;
    u.segment<3>(at) = translation + rotation.cross(corners[i].mid_mm);
    u[at + 3] = rotation.dot(corners[i].tangents[0]);
    u[at + 4] = rotation.dot(corners[i].tangents[1]);
  }
  return u;
}

TEST(Mitc4, RigidMotionGivesNoForce) {
  const auto corners = CurvedElement();
  const ElementMatrix k = Mitc4Stiffness(corners, kThickness, kMaterial);
  for (int axis = 0; axis < 3; ++axis) {
    for (const auto& [t, r] : {std::pair(Vec3(Vec3::Unit(axis)), Vec3(Vec3::Zero())),
                               std::pair(Vec3(Vec3::Zero()), Vec3(Vec3::Unit(axis)))}) {
      const ElementVector u = RigidMotion(corners, t, r);
      EXPECT_LT((k * u).norm(), 1e-12 * k.norm() * u.norm());
    }
  }
}

TEST(Mitc4, HasSixZeroEnergyModesAndNoMore) {
  const ElementMatrix k = Mitc4Stiffness(CurvedElement(), kThickness, kMaterial);
  EXPECT_LT((k - k.transpose()).norm(), 1e-13 * k.norm());
  const Eigen::SelfAdjointEigenSolver<ElementMatrix> eigen(k);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(eigen.eigenvalues()[i], 0, 1e-12 * eigen.eigenvalues()[19]);
  EXPECT_GT(eigen.eigenvalues()[6], 1e-6 * eigen.eigenvalues()[19]);
}

// Five distorted quadrilaterals that fill a rectangle (MacNeal and Harder 1985): with the exact linear field
// on the outer nodes, the inner nodes must be in equilibrium at the exact linear field.
class PatchTest : public ::testing::Test {
 protected:
  static constexpr double kA = 0.24, kB = 0.12, kPatchThickness = 0.01;
  const std::array<Vec3, 8> points_ = {Vec3(0, 0, 0),       Vec3(kA, 0, 0),      Vec3(kA, kB, 0),
                                       Vec3(0, kB, 0),      Vec3(0.04, 0.02, 0), Vec3(0.18, 0.03, 0),
                                       Vec3(0.16, 0.08, 0), Vec3(0.08, 0.08, 0)};
  const std::array<std::array<size_t, 4>, 5> elements_ = {
      {{0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}, {4, 5, 6, 7}}};

  // Largest force or moment on an inner node, over the largest on an outer one.
  template <typename Field>
  double InnerResidual(const Field& field) const {
    Eigen::Matrix<double, 8 * kDofsPerNode, 1> force = Eigen::Matrix<double, 8 * kDofsPerNode, 1>::Zero();
    for (const auto& e : elements_) {
      std::array<ShellCorner, 4> corners;
      ElementVector u;
      for (size_t i = 0; i < 4; ++i) {
        corners[i] = Corner(points_[e[i]], Vec3::UnitZ());
        const auto [translation, rotation] = field(points_[e[i]]);
        const auto at = static_cast<Eigen::Index>(i) * kDofsPerNode;
        u.segment<3>(at) = translation;
        u[at + 3] = rotation.dot(corners[i].tangents[0]);
        u[at + 4] = rotation.dot(corners[i].tangents[1]);
      }
      const ElementVector f = Mitc4Stiffness(corners, kPatchThickness, {1e6, 0.25}) * u;
      for (size_t i = 0; i < 4; ++i) {
        force.segment<kDofsPerNode>(static_cast<Eigen::Index>(e[i]) * kDofsPerNode) +=
            f.segment<kDofsPerNode>(static_cast<Eigen::Index>(i) * kDofsPerNode);
      }
    }
    return force.tail<4 * kDofsPerNode>().lpNorm<Eigen::Infinity>() /
           force.head<4 * kDofsPerNode>().lpNorm<Eigen::Infinity>();
  }
};

TEST_F(PatchTest, MembraneIsExact) {
  const auto field = [](const Vec3& p) {
    return std::pair(Vec3(1e-3 * (p.x() + p.y() / 2), 1e-3 * (p.y() + p.x() / 2), 0), Vec3(Vec3::Zero()));
  };
  EXPECT_LT(InnerResidual(field), 1e-10);
}

TEST_F(PatchTest, BendingIsExact) {
  // w = c (x^2 + x y + y^2) / 2: constant curvature, no shear; rotation = (dw/dy, -dw/dx, 0).
  const auto field = [](const Vec3& p) {
    const double c = 1e-3, x = p.x(), y = p.y();
    return std::pair(Vec3(0, 0, c * (x * x + x * y + y * y) / 2), Vec3(c * (x / 2 + y), -c * (x + y / 2), 0));
  };
  EXPECT_LT(InnerResidual(field), 1e-9);
}

TEST(Mitc4, PressureLoadIsPressureTimesTheMidSurfacesArea) {
  const double r = 38.25, half_angle = 0.13;
  const auto at = [&](double angle, double z) {
    const Vec3 n(std::cos(angle), std::sin(angle), 0);
    return Corner(r * n + Vec3(0, 0, z), n);
  };
  const ElementVector load =
      PressureLoad({at(-half_angle, 0), at(half_angle, 0), at(half_angle, 18), at(-half_angle, 18)});
  Vec3 sum = Vec3::Zero();
  for (Eigen::Index i = 0; i < 4; ++i) sum += load.segment<3>(i * kDofsPerNode);
  EXPECT_NEAR(sum.x(), 2 * r * std::sin(half_angle) * 18, 1e-9);
  EXPECT_NEAR(sum.y(), 0, 1e-12);
  EXPECT_NEAR(sum.z(), 0, 1e-12);
}

}  // namespace
}  // namespace taclink
