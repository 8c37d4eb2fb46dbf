#include "sensing/estimation/known_loads_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

// In length units.
constexpr double kNegligibleMm = 1;  // by one standard deviation: a first-order step is good enough
constexpr double kModelMm = 0.1;     // error of a marker that no contact moves, besides the cameras'
constexpr double kSettledMm = 0.02;
constexpr double kHuber = 1.5;  // standard deviations
constexpr int kMostSteps = 12, kMostHalvings = 4;

// The longest motion of a marker by these shares of the errors.
double LargestMm(const UntouchedSkin& skin, const Vec4& loads) {
  double largest2 = 0;
  for (Eigen::Index row = 0; row + 2 < skin.markers_by_loads.rows(); row += 3)
    largest2 = std::max(largest2, (skin.markers_by_loads.middleRows<3>(row) * loads).squaredNorm());
  return std::sqrt(largest2);
}

// Normal equations of the robust sum about a skin, and the sum itself.
using Shares = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, KnownLoads::kCount, 1>;
struct RobustSum {
  double value = 0;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, KnownLoads::kCount,
                KnownLoads::kCount>
      information;
  Shares pull;
};
RobustSum SumOf(const UntouchedSkin& skin, const MarkerObservations& observed,
                const Eigen::VectorXd& baseline_mm, const KnownLoadsErrors& errors, const Shares& shares,
                double model_mm2) {
  RobustSum sum{.value = shares.squaredNorm(),
                .information = decltype(RobustSum::information)::Identity(shares.size(), shares.size()),
                .pull = -shares};
  for (size_t m = 0; m < observed.information.size(); ++m) {
    const Mat3& seen = observed.information[m];
    if (seen.isZero(0)) continue;
    const auto at = 3 * static_cast<Eigen::Index>(m);
    const Vec3 off =
        observed.displacement_mm[m] + baseline_mm.segment<3>(at) - skin.markers_mm.segment<3>(at);
    const Mat3 weight = (Mat3::Identity() + model_mm2 * seen).inverse() * seen;
    const double deviations = std::sqrt(std::max(off.dot(weight * off), 0.0));
    const bool is_far = deviations > kHuber;
    const double trust = is_far ? kHuber / deviations : 1;
    const Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, KnownLoads::kCount> by =
        skin.markers_by_loads.middleRows<3>(at) * errors;
    sum.information.noalias() += trust * (by.transpose() * weight * by);
    sum.pull.noalias() += trust * (by.transpose() * (weight * off));
    sum.value += is_far ? kHuber * (2 * deviations - kHuber) : deviations * deviations;
  }
  return sum;
}

// The errors that move a marker far enough to matter.
KnownLoadsErrors LargeErrors(const UntouchedSkin& skin, const KnownLoadsErrors& errors,
                             double negligible_mm) {
  KnownLoadsErrors large(KnownLoads::kCount, 0);
  for (Eigen::Index k = 0; k < errors.cols(); ++k) {
    if (LargestMm(skin, errors.col(k)) < negligible_mm) continue;
    large.conservativeResize(Eigen::NoChange, large.cols() + 1);
    large.rightCols<1>() = errors.col(k);
  }
  return large;
}

}  // namespace

KnownLoads FitKnownLoads(SkinMechanics& mechanics, const MarkerObservations& observed,
                         const Eigen::VectorXd& baseline_mm, const KnownLoads& measured,
                         const KnownLoadsErrors& all_errors) {
  const double unit = mechanics.length_unit(), model_mm2 = std::pow(kModelMm * unit, 2);
  const UntouchedSkin* skin = mechanics.Untouched(measured);
  if (skin == nullptr) return measured;
  const KnownLoadsErrors errors = LargeErrors(*skin, all_errors, kNegligibleMm * unit);
  if (errors.cols() == 0) return measured;
  const auto at = [&](const Shares& shares) {
    return KnownLoads::FromStacked(measured.Stacked() + errors * shares);
  };
  Shares shares = Shares::Zero(errors.cols());
  RobustSum sum = SumOf(*skin, observed, baseline_mm, errors, shares, model_mm2);
  for (int step = 0; step < kMostSteps; ++step) {
    Shares more = sum.information.llt().solve(sum.pull);
    if (!more.allFinite()) return measured;
    if (LargestMm(*skin, errors * more) < kSettledMm * unit) break;
    bool is_lower = false;
    for (int halving = 0; halving < kMostHalvings && !is_lower; ++halving, more /= 2) {
      skin = mechanics.Untouched(at(shares + more));
      if (skin == nullptr) continue;
      const RobustSum next = SumOf(*skin, observed, baseline_mm, errors, shares + more, model_mm2);
      is_lower = next.value < sum.value;
      if (!is_lower) continue;
      shares += more;
      sum = next;
    }
    if (!is_lower) break;
  }
  return at(shares);
}

}  // namespace taclink
