#pragma once

#include <array>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/mechanics/shape_functions.h"

namespace taclink {

/// Mid-surface point and director of an element's corner: 4 x (3 + 3) numbers, corner by corner.
using ElementState = Eigen::Matrix<double, 24, 1>;
using ElementHessian = Eigen::Matrix<double, 24, 24>;

/// How many derivatives of the energy are wanted.
enum class DerivativeOrder { kEnergy, kGradient, kHessian };

/// What an element adds to the energy and its derivatives by the ElementState.
struct ElementResponse {
  void SetZero() {
    energy_nmm = 0;
    gradient.setZero();
    hessian.setZero();
  }

  double energy_nmm = 0;
  ElementState gradient = ElementState::Zero();  ///< N; by the director N mm
  ElementHessian hessian = ElementHessian::Zero();
};

/// Geometrically exact 4-node shell (MITC4, total Lagrangian); see nonlinear_shell.md. Strains are quadratic
/// in the corners' points and directors, for any rotation. Constant after construction.
class NonlinearElement {
 public:
  /// `rest`: its unstressed state, corners counter-clockwise seen from where the directors point to.
  NonlinearElement(const ElementState& rest, double thickness_mm, const Material& material);

  /// The energy is infinite where the material law has no answer.
  void Add(DerivativeOrder order, const ElementState& state, ElementResponse& response) const;

 private:
  // Through-thickness and in-plane Gauss point: covariant to Cartesian strains, both halves of them.
  struct Point {
    double height_mm = 0;  // above the mid-surface
    double weight_mm3 = 0;
    Mat3 in_plane;                      // e11, e22, 2 e12 to Cartesian
    Eigen::Matrix<double, 2, 3> warp;   // e11, e22, 2 e12 to transverse shears, where a director leans
    Eigen::Matrix<double, 2, 4> shear;  // tying shears to Cartesian transverse shears
    Vec3 rest_metric;                   // g11, g22, 2 g12 at rest
  };

  struct Sums;
  using Corners = Eigen::Matrix<double, 3, 4>;
  using Tied = Eigen::Matrix<double, 4, 24>;  // tying shears by the element's state

  template <DerivativeOrder kOrder>
  void AddUpTo(const ElementState& state, ElementResponse& response) const;
  void AddStiffness(const Point& point, const ShapeFunctions& n, const Vec3& g1, const Vec3& g2,
                    const Vec3& s, const Mat3& tangent_mpa, Sums& sums) const;
  Tied TyingByState(const Corners& mids, const Corners& directors) const;
  void AddHessian(const Sums& sums, const Tied& by_state, ElementHessian& hessian) const;

  double thickness_mm_;
  Material material_;
  double shear_modulus_mpa_;
  std::array<std::array<Point, 2>, 4> points_;
  Eigen::Vector4d rest_tying_;
};

}  // namespace taclink
