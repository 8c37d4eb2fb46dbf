#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace taclink {

/// Normal equations of inward forces at markers, after other parameters were eliminated: T'WT and T'Wy of
/// residuals y with T the residuals by forces, and y'Wy.
struct TouchEquations {
  double squares = 0;
  Eigen::VectorXd pulls;   ///< by force
  Eigen::MatrixXd normal;  ///< forces x forces
};

/// Forces that explain the residuals.
struct SelectedTouches {
  static constexpr int kMost = 3;
  int count = 0;
  std::array<Eigen::Index, kMost> at = {};  ///< columns of T
  std::array<double, kMost> force_n = {};
  double gain = 0;  ///< of squares
};

enum class TouchSign : uint8_t {
  kPush,  ///< forces only push
  kAny    ///< they correct an estimate
};

/// Greedy forward selection of at most `most` (up to SelectedTouches::kMost) forces, each of which explains
/// 5 % of the squares or more. Allocates nothing.
SelectedTouches SelectTouches(const TouchEquations& equations, int most, TouchSign sign);

}  // namespace taclink
