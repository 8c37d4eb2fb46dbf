#include "sensing/estimation/camera_noise.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace taclink {

Mat3 NoiseOf(const Mat3& information, double unseen_mm) {
  const double least = 1 / (unseen_mm * unseen_mm);
  if (!information.allFinite()) return unseen_mm * unseen_mm * Mat3::Identity();
  Eigen::SelfAdjointEigenSolver<Mat3> modes;
  modes.computeDirect(information);
  return modes.eigenvectors() * modes.eigenvalues().cwiseMax(least).cwiseInverse().asDiagonal() *
         modes.eigenvectors().transpose();
}

SeenNoise SeenNoiseOf(const Mat3& information, double unseen_mm) {
  const double least = 1 / (kUnseenShare * unseen_mm * unseen_mm);
  if (!information.allFinite() || information.isZero()) return {};
  Eigen::SelfAdjointEigenSolver<Mat3> modes;
  modes.computeDirect(information);  // the least first
  const auto seen = (modes.eigenvalues().array() > least).count();
  return {.axes = modes.eigenvectors().rightCols(seen),
          .variances_mm2 = modes.eigenvalues().tail(seen).cwiseInverse()};
}

// The least eigenvalue is no smaller than the determinant over the square of half the trace.
bool IsSurelySeen(const Mat3& information, double least) {
  const double half = information.trace() / 2;
  return half > 0 && information.determinant() > least * half * half;
}

// By traces where all is seen.
NoiseChange ChangeOf(const Mat3& then_mm2, const Mat3& information, double unseen_mm) {
  if (IsSurelySeen(information, 1 / (kUnseenShare * unseen_mm * unseen_mm)))
    return {then_mm2.trace(), NoiseTraceOf(information, unseen_mm)};
  const SeenNoise seen = SeenNoiseOf(information, unseen_mm);
  return {(seen.axes.transpose() * then_mm2 * seen.axes).trace(), seen.variances_mm2.sum()};
}

// Without the eigenvalues where all is seen: of the adjugate over the determinant.
double NoiseTraceOf(const Mat3& information, double unseen_mm) {
  const Mat3& a = information;
  if (!IsSurelySeen(a, 1 / (unseen_mm * unseen_mm))) return NoiseOf(a, unseen_mm).trace();
  const double minors = a(1, 1) * a(2, 2) - a(1, 2) * a(2, 1) + a(0, 0) * a(2, 2) - a(0, 2) * a(2, 0) +
                        a(0, 0) * a(1, 1) - a(0, 1) * a(1, 0);
  return minors / a.determinant();
}

}  // namespace taclink
