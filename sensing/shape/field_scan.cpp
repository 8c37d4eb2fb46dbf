#include "sensing/shape/field_scan.h"

#include <cmath>

namespace taclink {

FieldScan::FieldScan(const SkinBasis& basis) : basis_(basis), paths_(basis.paths()), rings_(basis.rings()) {
  const int harmonics = paths_ / 2 + 1;
  waves_.resize(paths_, 2 * harmonics);
  half_on_.resize(paths_, 2 * harmonics);
  for (int h = 0; h < harmonics; ++h) {
    kernels_.push_back(basis.Harmonic(h));
    // The inverse transform's weight goes half to each way.
    const double weight = std::sqrt((h == 0 || 2 * h == paths_ ? 1.0 : 2.0) / paths_);
    for (int k = 0; k < paths_; ++k) {
      waves_(k, 2 * h) = weight * std::cos(2 * kPi * h * k / paths_);
      waves_(k, 2 * h + 1) = weight * std::sin(2 * kPi * h * k / paths_);
      half_on_(k, 2 * h) = weight * std::cos(2 * kPi * h * (k + 0.5) / paths_);
      half_on_(k, 2 * h + 1) = weight * std::sin(2 * kPi * h * (k + 0.5) / paths_);
    }
  }
  amplitudes_.resize(2 * harmonics, 3 * rings_);
  answers_.resize(2 * harmonics, basis.load_columns());
  along_.resize(3, paths_);
  for (int width = 0; width < SkinBasis::kBellWidths; ++width) {
    for (int ring = 0; ring < rings_; ++ring) {
      Eigen::MatrixXd around(paths_, paths_);
      for (int a = 0; a < paths_; ++a) {
        for (int b = 0; b < paths_; ++b) around(a, b) = basis.Around(width)(ring, std::abs(a - b));
      }
      around_.push_back(std::move(around));
    }
  }
}

void FieldScan::Correlate(const Eigen::VectorXd& v, Eigen::VectorXd& correlations) {
  correlations.resize(basis_.fields());
  CorrelateLoads(v, correlations);
  CorrelateBells(v, correlations);
  // The answers to the loads hold them.
  for (int wave = 0; wave < SkinBasis::kWaves; ++wave) {
    const int h = SkinBasis::HarmonicOf(wave), row = 2 * h + (SkinBasis::IsSine(wave) ? 1 : 0);
    const double weight = waves_(0, 2 * h);
    for (int ring = 0; ring < basis_.wave_rings(); ++ring) {
      correlations[basis_.first_wave() + wave * basis_.wave_rings() + ring] =
          answers_(row, basis_.InwardColumn(ring)) / weight;
    }
  }
}

void FieldScan::CorrelateLoads(const Eigen::VectorXd& v, Eigen::VectorXd& correlations) {
  using Rows = Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic>>;
  for (int ring = 0; ring < rings_; ++ring) {
    const Rows rows(v.data() + 3 * ring * paths_, 3, paths_);
    amplitudes_.middleCols<3>(3 * ring).transpose().noalias() = rows.lazyProduct(waves_);
  }
  // Two families a harmonic: (cos, sin, cos) and, a quarter wave on, (sin, -cos, sin).
  const int harmonics = static_cast<int>(kernels_.size());
  for (int h = 0; h < harmonics; ++h) {
    auto cosines = amplitudes_.row(2 * h), sines = amplitudes_.row(2 * h + 1);
    for (int ring = 0; ring < rings_; ++ring) {
      const double c = cosines[3 * ring + 1];
      cosines[3 * ring + 1] = sines[3 * ring + 1];
      sines[3 * ring + 1] = -c;
    }
    answers_.middleRows<2>(2 * h).noalias() =
        amplitudes_.middleRows<2>(2 * h).lazyProduct(kernels_[static_cast<size_t>(h)]);
    auto first = answers_.row(2 * h), second = answers_.row(2 * h + 1);
    for (int ring = 0; ring < rings_; ++ring) {
      const double s = first[3 * ring + 1];
      first[3 * ring + 1] = -second[3 * ring + 1];
      second[3 * ring + 1] = s;
    }
  }
  const int on = basis_.columns_on_paths(), all = basis_.load_columns();
  Eigen::Map<Eigen::MatrixXd> by_column(correlations.data(), paths_, all);
  by_column.leftCols(on).noalias() = waves_.lazyProduct(answers_.leftCols(on));
  by_column.rightCols(all - on).noalias() = half_on_.lazyProduct(answers_.rightCols(all - on));
}

void FieldScan::CorrelateBells(const Eigen::VectorXd& v, Eigen::VectorXd& correlations) {
  using Rows = Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic>>;
  using MutableRows = Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic>>;
  constexpr double kNothing = 1e-3;
  for (int width = 0; width < SkinBasis::kBellWidths; ++width) {
    for (int center = 0; center < rings_; ++center) {
      along_.setZero();
      for (int ring = 0; ring < rings_; ++ring) {
        const double weight = basis_.Along(width)(center, ring);
        if (weight > kNothing) along_ += weight * Rows(v.data() + 3 * ring * paths_, 3, paths_);
      }
      MutableRows rows(correlations.data() + basis_.loads() + 3 * (width * rings_ + center) * paths_, 3,
                       paths_);
      rows.noalias() = along_.lazyProduct(around_[static_cast<size_t>(width * rings_ + center)]);
    }
  }
}

}  // namespace taclink
