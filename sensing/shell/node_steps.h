#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

// Measures of a step of a skin's degrees of freedom (NonlinearShell::Step), whose free nodes have all five.

/// The longest translation of a node, mm.
inline double LongestTranslation(const Eigen::VectorXd& step) {
  double longest2 = 0;
  for (Eigen::Index i = 0; i + 2 < step.size(); i += kNodeDofs)
    longest2 = std::max(longest2, step.segment<3>(i).squaredNorm());
  return std::sqrt(longest2);
}

/// Likewise, of a point `arm_mm` from the mid-surface: rotations count, too.
inline double LongestMotion(const Eigen::VectorXd& step, double arm_mm) {
  double longest2 = 0;
  for (Eigen::Index i = 0; i + 4 < step.size(); i += kNodeDofs)
    longest2 = std::max(
        {longest2, step.segment<3>(i).squaredNorm(), arm_mm * arm_mm * step.segment<2>(i + 3).squaredNorm()});
  return std::sqrt(longest2);
}

/// The share of a step, at most 1, whose translations (by coordinate) and rotations stay within these limits.
inline double ShareWithin(const Eigen::VectorXd& step, double longest_mm, double most_rad) {
  double share = 1;
  for (Eigen::Index i = 0; i < step.size(); ++i) {
    const double limit = i % kNodeDofs < 3 ? longest_mm : most_rad;
    share = std::min(share, limit / std::max(std::abs(step[i]), limit));
  }
  return share;
}

}  // namespace taclink
