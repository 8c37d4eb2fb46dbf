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
/// The trace of NoiseOf.
double NoiseTraceOf(const Mat3& information, double unseen_mm);
/// Whether no direction has less than `least` of the information, 1/mm^2. Quick: false may be wrong.
bool IsSurelySeen(const Mat3& information, double least);

}  // namespace taclink
