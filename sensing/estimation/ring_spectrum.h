#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

class SkinMechanics;

/// Discrete Fourier transform of stacked marker vectors around the axis of a skin of revolution. `period`
/// paths of markers form a group; all groups are equal but for a rotation. In cylindrical coordinates
/// (radial, tangential, axial) the entries of a group, b of them by ring, path and component, are transformed
/// over the N groups with an orthonormal real basis:
///   c_k = sqrt(2/N) sum_g x_g cos(k theta g),  s_k = sqrt(2/N) sum_g x_g sin(k theta g),  theta = 2 pi / N,
/// with 1/N for 2/N and without s_k if k is 0 or N/2. A linear map that commutes with the rotation by a group
/// is one complex matrix A_k per harmonic: c - i s becomes A_k (c - i s) [davis1979]. Immutable.
class RingSpectrum {
 public:
  /// Requires a number of paths that is a multiple of `period`.
  RingSpectrum(const SkinMechanics& mechanics, int period);

  int groups() const { return groups_; }
  int period() const { return period_; }
  int harmonics() const { return groups_ / 2 + 1; }
  Eigen::Index block() const { return block_; }
  bool IsReal(int harmonic) const { return harmonic == 0 || 2 * harmonic == groups_; }
  double Angle(int harmonic, int groups) const;
  /// The first row of c_k among the transformed; s_k, if there is one, follows it.
  Eigen::Index Row(int harmonic) const { return harmonic == 0 ? 0 : block_ * (2 * harmonic - 1); }

  /// Stacked markers by columns: to `parts`, which has one column per basis vector, in the order of Row(),
  /// and block() rows per column of x.
  void Transform(const Eigen::Ref<const Eigen::MatrixXf>& x, Eigen::MatrixXf& parts) const;
  /// Of one vector.
  Eigen::VectorXf TransformBack(const Eigen::MatrixXf& parts) const;

  int GroupOf(int marker) const { return marker % paths_ / period_; }
  /// The first of a marker's three entries in its group.
  Eigen::Index PlaceOf(int marker) const {
    return 3 * (marker / paths_ * period_ + marker % paths_ % period_);
  }
  /// From cylindrical coordinates at a marker to those of the link.
  Eigen::Matrix3f FrameOf(int marker) const;

 private:
  int paths_, rings_, period_, groups_;
  Eigen::Index block_;
  Eigen::Matrix2Xf outward_;  // by path: unit, radial
  Eigen::MatrixXf basis_;     // groups x basis vectors
};

}  // namespace taclink
