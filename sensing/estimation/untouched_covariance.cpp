#include "sensing/estimation/untouched_covariance.h"

#include <Eigen/Eigenvalues>

#include "sensing/core/median.h"
#include "sensing/estimation/camera_noise.h"
#include "sensing/shell/dense.h"

namespace taclink {
namespace {

constexpr double kMostHidden = 0.25;  // of the markers: so many may be taken out of the problem

bool IsMany(size_t hidden, size_t markers) {
  return static_cast<double>(hidden) > kMostHidden * static_cast<double>(markers);
}

// Of a direction that is not seen, the usual one of those that are: a frame in which it is seen then needs no
// other covariance, and what is not seen is taken out of the problem (LoadEstimator::Hide). Not if there are
// many: what that leaves of a column would be rounding.
std::vector<Mat3> NoiseOfAll(const MarkerObservations& observed, double unseen_mm) {
  const double least = 1 / (kUnseenShare * unseen_mm * unseen_mm);
  std::vector<double> variances_mm2;
  for (const Mat3& information : observed.information) {
    if (information.allFinite() && IsSurelySeen(information, least))
      variances_mm2.push_back(NoiseTraceOf(information, unseen_mm) / 3);
  }
  const size_t unseen = observed.information.size() - variances_mm2.size();
  const double usual_mm2 =
      IsMany(unseen, observed.information.size()) ? unseen_mm * unseen_mm : Median(variances_mm2);
  std::vector<Mat3> noise_mm2;
  for (const Mat3& information : observed.information) {
    const SeenNoise seen = SeenNoiseOf(information, unseen_mm);
    noise_mm2.emplace_back(usual_mm2 * (Mat3::Identity() - seen.axes * seen.axes.transpose()) +
                           seen.axes * seen.variances_mm2.asDiagonal() * seen.axes.transpose());
  }
  return noise_mm2;
}

}  // namespace

KnownLoadsErrors ErrorsOf(double pressure_sigma_mpa, const Mat3& specific_force_covariance) {
  KnownLoadsErrors errors = KnownLoadsErrors::Zero(KnownLoads::kCount, 1);
  errors(0, 0) = pressure_sigma_mpa;
  if (specific_force_covariance.isZero(0)) return errors;
  const Eigen::SelfAdjointEigenSolver<Mat3> modes(specific_force_covariance);
  errors.conservativeResize(Eigen::NoChange, KnownLoads::kCount);
  errors.rightCols<3>().setZero();
  errors.bottomRightCorner<3, 3>() =
      modes.eigenvectors() * modes.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  return errors;
}

bool KnownLoadsPrior::IsAbout(const KnownLoadsErrors& errors) const {
  if (errors.cols() != now.cols()) return false;
  const Vec4 mine = now.rowwise().norm(), others = errors.rowwise().norm();
  return (mine.array() <= kSameNoise * others.array()).all() &&
         (others.array() <= kSameNoise * mine.array()).all();
}

std::shared_ptr<const UntouchedCovariance> UntouchedCovariance::Make(Linearization& skin,
                                                                     const MarkerCovariance& model,
                                                                     const MarkerObservations& observed,
                                                                     const KnownLoadsPrior& prior) {
  auto made = std::make_shared<UntouchedCovariance>();
  Eigen::MatrixXd all_mm2;
  model.WriteUntouched(skin, all_mm2);
  made->unseen_mm = model.unseen_mm();
  made->noise_mm2 = NoiseOfAll(observed, made->unseen_mm);
  made->baseline_errors = prior.baseline;
  made->by_baseline_mm = prior.baseline_mm;
  made->by_baseline_mm.conservativeResize(all_mm2.rows(), prior.baseline_mm.cols());
  if (made->by_baseline_mm.cols() > 0)  // Eigen divides by their number
    all_mm2.selfadjointView<Eigen::Lower>().rankUpdate(made->by_baseline_mm);
  for (size_t m = 0; m < observed.information.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    auto block = all_mm2.block<3, 3>(at, at);
    const auto bow_mm = model.bow_mm().segment<3>(at);
    made->marker_mm2.emplace_back(Mat3(block.selfadjointView<Eigen::Lower>()) - bow_mm * bow_mm.transpose());
    block += made->noise_mm2[m];
  }
  made->covariance_mm2 = all_mm2.cast<float>();
  if (!dense::Cholesky(all_mm2)) return nullptr;
  made->factor = all_mm2.cast<float>();
  return made;
}

bool UntouchedCovariance::HasBaseline(const KnownLoadsPrior& prior) const {
  constexpr double kSameMm = 1e-6;
  const Eigen::MatrixXd& baseline_mm = prior.baseline_mm;
  if (baseline_mm.cols() != by_baseline_mm.cols()) return by_baseline_mm.isZero(kSameMm);
  return baseline_mm.cols() == 0 || (baseline_mm - by_baseline_mm).isZero(kSameMm);
}

bool UntouchedCovariance::LosesFew(const MarkerObservations& observed) const {
  const double unseen_mm2 = kUnseenShare * unseen_mm * unseen_mm;
  size_t lost = 0;
  for (size_t m = 0; m < noise_mm2.size(); ++m) {
    const double now_mm2 = NoiseTraceOf(observed.information[m], unseen_mm);
    if (noise_mm2[m].trace() < unseen_mm2 && now_mm2 > kSameNoise * kSameNoise * noise_mm2[m].trace()) ++lost;
  }
  return !IsMany(lost, noise_mm2.size());
}

bool UntouchedCovariance::IsGoodFor(const MarkerObservations& observed, const KnownLoadsPrior& prior) const {
  int better = 0;
  for (size_t m = 0; m < noise_mm2.size(); ++m) {
    const auto [then, now] = ChangeOf(noise_mm2[m], observed.information[m], unseen_mm);
    if (then > kSameNoise * kSameNoise * now) ++better;
  }
  return better <= kOtherNoiseShare * static_cast<double>(noise_mm2.size()) && LosesFew(observed) &&
         HasBaseline(prior);
}

}  // namespace taclink
