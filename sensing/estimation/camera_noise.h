#pragma once

#include <Eigen/Core>

#include "sensing/core/geometry.h"

namespace taclink {

/// A marker's covariance by what cameras say of it, mm^2. `information`: 1/mm^2, symmetric; a direction of
/// less than 1 / unseen_mm^2, or an information that is not finite, counts as that.
Mat3 NoiseOf(const Mat3& information, double unseen_mm);
/// A direction with more than that share of the variance of one that is not seen is not seen.
constexpr double kUnseenShare = 0.3;
/// The directions in which cameras see a marker, and its variance in each.
struct SeenNoise {
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 3> axes;  ///< orthonormal
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 3, 1> variances_mm2;
};
SeenNoise SeenNoiseOf(const Mat3& information, double unseen_mm);
/// The variances that two covariances have in the directions in which a marker is seen now, summed: `then` of
/// `then_mm2`, `now` by `information`.
struct NoiseChange {
  double then_mm2 = 0, now_mm2 = 0;
};
NoiseChange ChangeOf(const Mat3& then_mm2, const Mat3& information, double unseen_mm);
/// The trace of NoiseOf.
double NoiseTraceOf(const Mat3& information, double unseen_mm);
/// Whether no direction has less than `least` of the information, 1/mm^2. Quick: false may be wrong.
bool IsSurelySeen(const Mat3& information, double least);

}  // namespace taclink
