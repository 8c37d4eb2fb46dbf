#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sensing/estimation/factored_covariance.h"
#include "sensing/estimation/ring_spectrum.h"

namespace taclink {

/// What a covariance that is invariant under rotation by a group of markers (RingSpectrum) is made of; it is
/// the sum of the parts.
struct RingCovarianceParts {
  /// Stacked markers: the effect of an independent error of unit variance. There is one such error in each
  /// group, whose effect is rotated.
  Eigen::MatrixXf columns;
  Eigen::MatrixXd common;   ///< block x block, in cylindrical coordinates: alike between any two groups
  std::vector<Mat3> local;  ///< by ring, in cylindrical coordinates: of each marker alone
};

/// A covariance that is invariant under rotation by a group of markers: block-circulant, with one Hermitian
/// matrix S_k = L_k L_k^H per harmonic [davis1979]. B = L^-1 also commutes with that rotation: whitened
/// columns of equal loads are rotations of each other.
class RingCovariance : public FactoredCovariance {
 public:
  /// Null: the covariance is not positive definite.
  static std::shared_ptr<const RingCovariance> Make(std::shared_ptr<const RingSpectrum> spectrum,
                                                    const RingCovarianceParts& parts);

  const RingSpectrum& spectrum() const { return *spectrum_; }
  void Whiten(Eigen::Ref<Eigen::MatrixXf> x) const override;
  Eigen::VectorXf WhitenTransposed(const Eigen::VectorXf& x) const override;
  Eigen::VectorXf Times(const Eigen::VectorXf& x) const override;
  Eigen::Matrix3f Block(int marker, int other) const override;

  /// What Whiten gives for the same columns rotated by so many groups.
  void RotateWhitened(const Eigen::MatrixXf& whitened, int groups, Eigen::Ref<Eigen::MatrixXf> rotated) const;
  /// What Whiten gives for the sum of all rotations of each column.
  Eigen::MatrixXf SumOfRotations(const Eigen::MatrixXf& whitened) const;

 private:
  /// A complex matrix; no imaginary part: it is zero.
  struct Harmonic {
    Eigen::MatrixXf real, imaginary;
  };
  explicit RingCovariance(std::shared_ptr<const RingSpectrum> spectrum) : spectrum_(std::move(spectrum)) {}
  void SetBlocks();

  std::shared_ptr<const RingSpectrum> spectrum_;
  std::vector<Harmonic> covariance_mm2_, whitening_;  // S_k, L_k^-1
  std::vector<Eigen::MatrixXf> apart_mm2_;            // blocks of S, by the difference of the groups
};

}  // namespace taclink
