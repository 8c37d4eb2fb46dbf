#include "sensing/estimation/ring_covariance.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <complex>
#include <utility>

#include "sensing/shell/dense.h"

namespace taclink {
namespace {

// One basis vector's part of transformed columns: block x columns.
auto PartOf(const Eigen::MatrixXf& parts, Eigen::Index basis_vector, Eigen::Index block) {
  return Eigen::Map<const Eigen::MatrixXf>(parts.col(basis_vector).data(), block, parts.rows() / block);
}

}  // namespace

// With z = (c - i s) / sqrt(2) of the first group's errors, those of all N groups give S_k = N z z^H.
std::shared_ptr<const RingCovariance> RingCovariance::Make(std::shared_ptr<const RingSpectrum> spectrum,
                                                           const RingCovarianceParts& parts) {
  const Eigen::Index block = spectrum->block();
  const auto groups = static_cast<float>(spectrum->groups());
  std::shared_ptr<RingCovariance> made(new RingCovariance(spectrum));
  Eigen::MatrixXf transformed;
  spectrum->Transform(parts.columns, transformed);
  for (int k = 0; k < spectrum->harmonics(); ++k) {
    const bool is_real = spectrum->IsReal(k);
    Eigen::MatrixXf real = Eigen::MatrixXf::Zero(block, block), imaginary = real;
    const Eigen::Index first = spectrum->Row(k) / block;
    const auto cosine = PartOf(transformed, first, block);
    dense::AddProduct(is_real ? groups : groups / 2, cosine, cosine, true, real);
    if (!is_real) {
      const auto sine = PartOf(transformed, first + 1, block);
      dense::AddProduct(groups / 2, sine, sine, true, real);
      dense::AddProduct(groups / 2, cosine, sine, true, imaginary);
      imaginary -= imaginary.transpose().eval();
    }
    Eigen::MatrixXcd all(block, block);
    all.real() = real.cast<double>();
    all.imag() = imaginary.cast<double>();
    for (Eigen::Index at = 0; at < block; at += 3)
      all.block<3, 3>(at, at) +=
          parts.local[static_cast<size_t>(at / (3 * spectrum->period()))].cast<std::complex<double>>();
    if (k == 0) all += (spectrum->groups() * parts.common).cast<std::complex<double>>();
    const Eigen::LLT<Eigen::MatrixXcd> factor(all);
    if (factor.info() != Eigen::Success) return nullptr;
    const Eigen::MatrixXcd inverse = factor.matrixL().solve(Eigen::MatrixXcd::Identity(block, block));
    if (!inverse.allFinite()) return nullptr;
    const auto stored = [&](const Eigen::MatrixXcd& matrix) {
      return Harmonic{matrix.real().cast<float>(),
                      is_real ? Eigen::MatrixXf() : Eigen::MatrixXf(matrix.imag().cast<float>())};
    };
    made->covariance_mm2_.push_back(stored(all));
    made->whitening_.push_back(stored(inverse));
  }
  made->SetBlocks();
  return made;
}

// A (c - i s) = (Re c + Im s) - i (Re s - Im c).
void RingCovariance::Whiten(Eigen::Ref<Eigen::MatrixXf> x) const {
  const Eigen::Index block = spectrum_->block();
  Eigen::MatrixXf parts;
  spectrum_->Transform(x, parts);
  Eigen::MatrixXf cosine(block, x.cols()), sine(block, x.cols());
  for (int k = 0; k < spectrum_->harmonics(); ++k) {
    const Harmonic& by = whitening_[static_cast<size_t>(k)];
    const Eigen::Index row = spectrum_->Row(k);
    const auto c = PartOf(parts, row / block, block);
    dense::SetProduct(1, by.real, c, cosine);
    if (!spectrum_->IsReal(k)) {
      const auto s = PartOf(parts, row / block + 1, block);
      dense::AddProduct(1, by.imaginary, s, false, cosine);
      dense::SetProduct(1, by.real, s, sine);
      dense::AddProduct(-1, by.imaginary, c, false, sine);
      x.middleRows(row + block, block) = sine;
    }
    x.middleRows(row, block) = cosine;
  }
}

// The adjoint: A^H (c - i s) = (Re' c - Im' s) - i (Re' s + Im' c).
Eigen::VectorXf RingCovariance::WhitenTransposed(const Eigen::VectorXf& x) const {
  const Eigen::Index block = spectrum_->block();
  Eigen::MatrixXf parts(block, spectrum_->groups());
  for (int k = 0; k < spectrum_->harmonics(); ++k) {
    const Harmonic& by = whitening_[static_cast<size_t>(k)];
    const Eigen::Index row = spectrum_->Row(k), to = row / block;
    const auto c = x.segment(row, block);
    parts.col(to).noalias() = by.real.transpose() * c;
    if (spectrum_->IsReal(k)) continue;
    const auto s = x.segment(row + block, block);
    parts.col(to).noalias() -= by.imaginary.transpose() * s;
    parts.col(to + 1).noalias() = by.real.transpose() * s;
    parts.col(to + 1).noalias() += by.imaginary.transpose() * c;
  }
  return spectrum_->TransformBack(parts);
}

Eigen::VectorXf RingCovariance::Times(const Eigen::VectorXf& x) const {
  Eigen::MatrixXf from, parts(spectrum_->block(), spectrum_->groups());
  spectrum_->Transform(x, from);
  for (int k = 0; k < spectrum_->harmonics(); ++k) {
    const Harmonic& by = covariance_mm2_[static_cast<size_t>(k)];
    const Eigen::Index to = spectrum_->Row(k) / spectrum_->block();
    parts.col(to).noalias() = by.real * from.col(to);
    if (spectrum_->IsReal(k)) continue;
    parts.col(to).noalias() += by.imaginary * from.col(to + 1);
    parts.col(to + 1).noalias() = by.real * from.col(to + 1);
    parts.col(to + 1).noalias() -= by.imaginary * from.col(to);
  }
  return spectrum_->TransformBack(parts);
}

// The inverse transform of S_k.
void RingCovariance::SetBlocks() {
  const int groups = spectrum_->groups();
  for (int apart = 0; apart < groups; ++apart) {
    Eigen::MatrixXf& sum = apart_mm2_.emplace_back();
    sum.setZero(spectrum_->block(), spectrum_->block());
    for (int k = 0; k < spectrum_->harmonics(); ++k) {
      const Harmonic& by = covariance_mm2_[static_cast<size_t>(k)];
      const double angle = spectrum_->Angle(k, apart), scale = (spectrum_->IsReal(k) ? 1.0 : 2.0) / groups;
      sum += static_cast<float>(scale * std::cos(angle)) * by.real;
      if (!spectrum_->IsReal(k)) sum -= static_cast<float>(scale * std::sin(angle)) * by.imaginary;
    }
  }
}

Eigen::Matrix3f RingCovariance::Block(int marker, int other) const {
  const int groups = spectrum_->groups();
  const int apart = (spectrum_->GroupOf(marker) - spectrum_->GroupOf(other) + groups) % groups;
  return spectrum_->FrameOf(marker) *
         apart_mm2_[static_cast<size_t>(apart)].block<3, 3>(spectrum_->PlaceOf(marker),
                                                            spectrum_->PlaceOf(other)) *
         spectrum_->FrameOf(other).transpose();
}

// Rotation multiplies c - i s by exp(-i k theta g).
void RingCovariance::RotateWhitened(const Eigen::MatrixXf& whitened, int groups,
                                    Eigen::Ref<Eigen::MatrixXf> rotated) const {
  const Eigen::Index block = spectrum_->block();
  for (int k = 0; k < spectrum_->harmonics(); ++k) {
    const Eigen::Index row = spectrum_->Row(k);
    const auto cosine = static_cast<float>(std::cos(spectrum_->Angle(k, groups))),
               sine = static_cast<float>(std::sin(spectrum_->Angle(k, groups)));
    const auto c = whitened.middleRows(row, block);
    if (spectrum_->IsReal(k)) {
      rotated.middleRows(row, block) = cosine * c;
      continue;
    }
    const auto s = whitened.middleRows(row + block, block);
    rotated.middleRows(row, block) = cosine * c - sine * s;
    rotated.middleRows(row + block, block) = cosine * s + sine * c;
  }
}

Eigen::MatrixXf RingCovariance::SumOfRotations(const Eigen::MatrixXf& whitened) const {
  Eigen::MatrixXf sum = Eigen::MatrixXf::Zero(whitened.rows(), whitened.cols());
  sum.topRows(spectrum_->block()) =
      static_cast<float>(spectrum_->groups()) * whitened.topRows(spectrum_->block());
  return sum;
}

}  // namespace taclink
