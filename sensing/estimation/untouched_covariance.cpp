#include "sensing/estimation/untouched_covariance.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "sensing/core/median.h"
#include "sensing/estimation/camera_noise.h"

namespace taclink {
namespace {

constexpr double kMostHidden = 0.25;  // of the markers: so many may be taken out of the problem
// Of the markers: so many may be worse than their ring, each for three more columns of LoadEstimator.
constexpr double kMostWorse = 0.1;

bool IsMany(size_t hidden, size_t markers) {
  return static_cast<double>(hidden) > kMostHidden * static_cast<double>(markers);
}

bool IsOther(double variance_mm2, double other_mm2) {
  constexpr double kMost = kSameNoise * kSameNoise;
  return variance_mm2 > kMost * other_mm2 || other_mm2 > kMost * variance_mm2;
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

// Of one ring, in cylindrical coordinates: the mean over the markers that are seen in all directions, or over
// all if none is, and not much better or worse than the median one.
Mat3 NoiseOfRing(const RingSpectrum& spectrum, const MarkerObservations& observed,
                 const std::vector<Mat3>& noise_mm2, size_t first, double unseen_mm) {
  const double least = 1 / (kUnseenShare * unseen_mm * unseen_mm);
  const auto end = first + static_cast<size_t>(spectrum.groups() * spectrum.period());
  std::vector<size_t> markers;
  for (size_t m = first; m < end; ++m) {
    if (observed.information[m].allFinite() && IsSurelySeen(observed.information[m], least))
      markers.push_back(m);
  }
  if (markers.empty()) {
    markers.resize(end - first);
    std::iota(markers.begin(), markers.end(), first);
  }
  std::vector<double> traces;
  for (const size_t m : markers) traces.push_back(noise_mm2[m].trace());
  const double median = Median(traces);
  Mat3 sum = Mat3::Zero();
  int count = 0;
  for (const size_t m : markers) {
    if (IsOther(noise_mm2[m].trace(), median)) continue;
    const Mat3 frame = spectrum.FrameOf(static_cast<int>(m)).cast<double>();
    sum += frame.transpose() * noise_mm2[m] * frame;
    ++count;
  }
  return sum / count;
}

// Camera noise averaged by ring; nullopt if more than kOtherNoiseShare of the markers are better than that by
// more than kSameNoise, or kMostWorse worse, or if many are not seen in some direction: NoiseOfAll() gives
// these noise of another size.
std::optional<std::vector<Mat3>> NoiseByRing(const RingSpectrum& spectrum, const MarkerObservations& observed,
                                             const std::vector<Mat3>& noise_mm2, double unseen_mm) {
  const double least = 1 / (kUnseenShare * unseen_mm * unseen_mm);
  const auto is_hidden = [&](const Mat3& information) {
    return !information.allFinite() || !IsSurelySeen(information, least);
  };
  const auto hidden = std::ranges::count_if(observed.information, is_hidden);
  if (IsMany(static_cast<size_t>(hidden), noise_mm2.size())) return std::nullopt;
  const auto paths = static_cast<size_t>(spectrum.groups() * spectrum.period());
  std::vector<Mat3> by_ring;
  int better = 0, worse = 0;
  for (size_t first = 0; first < noise_mm2.size(); first += paths) {
    by_ring.push_back(NoiseOfRing(spectrum, observed, noise_mm2, first, unseen_mm));
    for (size_t m = first; m < first + paths; ++m) {
      const Mat3 frame = spectrum.FrameOf(static_cast<int>(m)).cast<double>();
      const auto [then, now] =
          ChangeOf(frame * by_ring.back() * frame.transpose(), observed.information[m], unseen_mm);
      if (IsOther(then, now)) ++(then > now ? better : worse);
    }
  }
  const auto markers = static_cast<double>(noise_mm2.size());
  if (better > kOtherNoiseShare * markers || worse > kMostWorse * markers) return std::nullopt;
  return by_ring;
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

std::shared_ptr<const UntouchedCovariance> UntouchedCovariance::Make(const Linearization& skin,
                                                                     const MarkerCovariance& model,
                                                                     const MarkerObservations& observed,
                                                                     const KnownLoadsPrior& prior) {
  auto made = std::make_shared<UntouchedCovariance>();
  const size_t markers = observed.information.size();
  made->unseen_mm = model.unseen_mm();
  made->noise_mm2 = NoiseOfAll(observed, made->unseen_mm);
  std::vector<double> best_mm2;
  for (const Mat3& noise : made->noise_mm2) best_mm2.push_back(noise.diagonal().minCoeff());
  made->usual_noise_mm = std::sqrt(Median(best_mm2));
  made->stray_mm_per_n = model.StrayDisplacements(skin);
  made->baseline_errors = prior.baseline;
  made->by_baseline_mm = prior.baseline_mm;
  made->by_baseline_mm.conservativeResize(3 * static_cast<Eigen::Index>(markers), prior.baseline_mm.cols());
  std::optional<std::vector<Mat3>> by_ring;
  if (skin.is_of_revolution() && model.spectrum())
    by_ring = NoiseByRing(*model.spectrum(), observed, made->noise_mm2, made->unseen_mm);
  if (by_ring) {
    RingCovarianceParts parts = model.UntouchedParts(skin);
    for (size_t ring = 0; ring < by_ring->size(); ++ring) parts.local[ring] += (*by_ring)[ring];
    for (size_t m = 0; m < markers; ++m) {
      const Mat3 frame = model.spectrum()->FrameOf(static_cast<int>(m)).cast<double>();
      made->noise_mm2[m] = frame * (*by_ring)[m * by_ring->size() / markers] * frame.transpose();
    }
    made->ring = RingCovariance::Make(model.spectrum(), parts);
    made->factored = made->ring;
  } else {
    Eigen::MatrixXd all_mm2;
    model.WriteUntouched(skin, all_mm2);
    for (size_t m = 0; m < markers; ++m) {
      const auto at = 3 * static_cast<Eigen::Index>(m);
      all_mm2.block<3, 3>(at, at) += made->noise_mm2[m];
    }
    const auto dense = std::make_shared<const DenseCovariance>(std::move(all_mm2));
    if (dense->is_factored()) made->factored = dense;
  }
  if (!made->factored) return nullptr;
  for (size_t m = 0; m < markers; ++m) {
    const auto marker = static_cast<int>(m);
    const auto bow_mm = model.bow_mm().segment<3>(3 * marker);
    made->marker_mm2.emplace_back(made->factored->Block(marker, marker).cast<double>() - made->noise_mm2[m] -
                                  bow_mm * bow_mm.transpose());
  }
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
