#include "sensing/pipeline/touch_selection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <optional>

namespace taclink {
namespace {

constexpr double kLeastMoreShare = 0.05;

// Least squares of the selected forces and one more. nullopt: singular, or a force has the wrong sign.
std::optional<SelectedTouches> FitWith(const TouchEquations& equations, SelectedTouches touches,
                                       Eigen::Index more, TouchSign sign) {
  touches.at[static_cast<size_t>(touches.count++)] = more;
  // Rows of touches that are not there are those of the identity.
  Eigen::Matrix<double, SelectedTouches::kMost, SelectedTouches::kMost> normal;
  normal.setIdentity();
  Eigen::Matrix<double, SelectedTouches::kMost, 1> pulls;
  pulls.setZero();
  for (int i = 0; i < touches.count; ++i) {
    const Eigen::Index at = touches.at[static_cast<size_t>(i)];
    pulls[i] = equations.pulls[at];
    for (int j = 0; j < touches.count; ++j)
      normal(i, j) = equations.normal(at, touches.at[static_cast<size_t>(j)]);
  }
  const auto factor = normal.llt();
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::Matrix<double, SelectedTouches::kMost, 1> force_n = factor.solve(pulls);
  if (sign == TouchSign::kPush && !(force_n.head(touches.count).minCoeff() > 0)) return std::nullopt;
  for (int i = 0; i < SelectedTouches::kMost; ++i) touches.force_n[static_cast<size_t>(i)] = force_n[i];
  touches.gain = force_n.dot(pulls);
  return touches;
}

}  // namespace

SelectedTouches SelectTouches(const TouchEquations& equations, int most, TouchSign sign) {
  SelectedTouches best;
  while (best.count < std::min(most, SelectedTouches::kMost)) {
    std::optional<SelectedTouches> better;
    const auto end = best.at.begin() + best.count;
    for (Eigen::Index k = 0; k < equations.pulls.size(); ++k) {
      if (std::find(best.at.begin(), end, k) != end) continue;
      const auto touches = FitWith(equations, best, k, sign);
      if (touches && (!better || touches->gain > better->gain)) better = touches;
    }
    if (!better || better->gain < best.gain + kLeastMoreShare * equations.squares) break;
    best = *better;
  }
  return best;
}

}  // namespace taclink
