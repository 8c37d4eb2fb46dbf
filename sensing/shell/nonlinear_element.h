#pragma once

#include <array>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/lanes.h"
#include "sensing/shell/shape_functions.h"

namespace taclink {

/// Mid-surface point and director of an element's corner: 4 x (3 + 3) numbers, corner by corner.
using ElementState = Eigen::Matrix<double, 24, 1>;
using ElementHessian = Eigen::Matrix<double, 24, 24>;

/// How many derivatives of the energy are wanted.
enum class DerivativeOrder { kEnergy, kGradient, kHessian };

/// What an element adds to the energy and its derivatives by the ElementState.
struct ElementResponse {
  void SetZero(DerivativeOrder order) {
    energy_nmm = 0;
    gradient.setZero();
    if (order == DerivativeOrder::kHessian) hessian.setZero();
  }

  double energy_nmm = 0;
  ElementState gradient = ElementState::Zero();  ///< N; by the director N mm
  ElementHessian hessian = ElementHessian::Zero();
};

/// Geometrically exact 4-node shell (MITC4 [dvorkin1984], total Lagrangian); see nonlinear_shell.md. Strains
/// are quadratic in the corners' points and directors, for any rotation. Constant after construction.
class NonlinearElement {
 public:
  /// `rest`: its unstressed state, corners counter-clockwise seen from where the directors point to.
  NonlinearElement(const ElementState& rest, double thickness_mm, const Material& material);

  /// The in-plane Gauss points at one height: covariant to Cartesian strains, both halves of them.
  struct Layer {
    double height_mm = 0;  ///< above the mid-surface
    Lanes weight_mm3;
    std::array<Lanes3, 3> in_plane;  ///< e11, e22, 2 e12 to Cartesian
    std::array<Lanes3, 2> warp;      ///< e11, e22, 2 e12 to transverse shears, where a director leans
    std::array<std::array<Lanes, 4>, 2> shear;  ///< tying shears to Cartesian transverse shears
    Lanes3 rest_metric;                         ///< g11, g22, 2 g12 at rest
  };

  /// As far below the mid-surface as above.
  const std::array<Layer, 2>& layers() const { return layers_; }
  /// Along xi and along eta.
  const std::array<double, 2>& shear_moduli_mpa() const { return shear_moduli_mpa_; }
  /// Of and by the tying shears, times mm (covariant).
  const Eigen::Matrix4d& tying_stiffness() const { return tying_stiffness_; }
  const Eigen::Vector4d& rest_tying() const { return rest_tying_; }

  /// The energy is infinite where the material law has no answer.
  void Add(DerivativeOrder order, const ElementState& state, ElementResponse& response) const;

 private:
  struct Strained;
  struct Sums;
  using Corners = Eigen::Matrix<double, 3, 4>;
  using Tied = Eigen::Matrix<double, 24, 4>;  // tying shears by the element's state

  void SetPoint(const Corners& mids, const Corners& directors, size_t p, Layer& layer);
  void Strain(const Layer& layer, const Corners& at_height, const Eigen::Vector4d& tying,
              Strained& strained) const;
  template <DerivativeOrder kOrder>
  void AddUpTo(const ElementState& state, ElementResponse& response) const;
  void AddStiffness(const Layer& layer, const Strained& strained, Sums& sums) const;
  Tied TyingByState(const Corners& mids, const Corners& directors) const;
  void AddHessian(const Sums& sums, const Tied& by_state, ElementHessian& hessian) const;
  void AddTying(const Sums& sums, const Tied& by_state, ElementHessian& hessian) const;

  double thickness_mm_;
  Material material_;
  std::array<double, 2> shear_moduli_mpa_;
  std::array<Layer, 2> layers_;
  Eigen::Matrix4d tying_stiffness_ = Eigen::Matrix4d::Zero();
  Eigen::Vector4d rest_tying_;
};

}  // namespace taclink
