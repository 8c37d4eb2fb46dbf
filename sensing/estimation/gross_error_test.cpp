#include "sensing/estimation/gross_error_test.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "sensing/estimation/camera_noise.h"

namespace taclink {
namespace {

constexpr double kForceN = 0.05;
// Standard deviation of a marker's coordinate, at least: the test is for errors of millimeters.
constexpr double kLeastNoiseMm = 0.1;
// Limit of chi^2 per number. Of 149 solids under five conditions none reaches 0.72; torn images reach 1.33
// and more. Strong drags move the skin farther than 10 mm and count as improbable forces and as nonlinearity:
// of 80 frames on both shipped skins (slack to 2.5 kPa, drags of 4 to 20 mm) the estimator answers 55, and
// none of these exceeds 3.8.
constexpr double kMostChi2 = 1, kMostChi2PerMm = 0.4, kLinearMm = 10;

// Camera noise averaged over each ring, in cylindrical coordinates.
std::vector<Mat3> NoiseByRing(const RingSpectrum& spectrum, const std::vector<Mat3>& noise_mm2,
                              double least_mm) {
  const auto paths = static_cast<size_t>(spectrum.groups() * spectrum.period());
  std::vector<Mat3> by_ring(noise_mm2.size() / paths, least_mm * least_mm * Mat3::Identity());
  for (size_t m = 0; m < noise_mm2.size(); ++m) {
    const Mat3 frame = spectrum.FrameOf(static_cast<int>(m)).cast<double>();
    by_ring[m / paths] += frame.transpose() * noise_mm2[m] * frame / static_cast<double>(paths);
  }
  return by_ring;
}

// Of markers that are seen worse than in `noise_mm2`, or not at all: what is more, by its principal axes.
Eigen::MatrixXf ColumnsOfWorse(const MarkerObservations& observed, const std::vector<Mat3>& noise_mm2,
                               double unseen_mm) {
  std::vector<std::pair<Eigen::Index, Vec3>> axes;
  for (size_t m = 0; m < noise_mm2.size(); ++m) {
    const double most_mm2 = kSameNoise * kSameNoise * noise_mm2[m].trace();
    if (NoiseTraceOf(observed.information[m], unseen_mm) < most_mm2) continue;
    Eigen::SelfAdjointEigenSolver<Mat3> more;
    more.computeDirect(NoiseOf(observed.information[m], unseen_mm) - noise_mm2[m]);
    for (int i = 0; i < 3; ++i) {
      if (more.eigenvalues()[i] > most_mm2 / 3)
        axes.emplace_back(static_cast<Eigen::Index>(3 * m),
                          std::sqrt(more.eigenvalues()[i]) * more.eigenvectors().col(i));
    }
  }
  Eigen::MatrixXf columns = Eigen::MatrixXf::Zero(3 * static_cast<Eigen::Index>(noise_mm2.size()),
                                                  static_cast<Eigen::Index>(axes.size()));
  for (size_t i = 0; i < axes.size(); ++i)
    columns.col(static_cast<Eigen::Index>(i)).segment<3>(axes[i].first) = axes[i].second.cast<float>();
  return columns;
}

}  // namespace

bool GrossErrorTest::Prepare(const Tangent& untouched) {
  const std::shared_ptr<const UntouchedCovariance>& now = untouched.loads.untouched();
  if (prepared_for_ == now) return covariance_ != nullptr;
  prepared_for_ = now;
  covariance_ = nullptr;
  const MarkerCovariance& model = untouched.loads.covariance();
  const auto& spectrum = model.spectrum();
  if (!now || !untouched.skin.is_of_revolution() || !spectrum) return false;
  const std::vector<Mat3> by_ring =
      NoiseByRing(*spectrum, now->noise_mm2, kLeastNoiseMm * mechanics_.length_unit());
  RingCovarianceParts parts = model.UntouchedParts(untouched.skin);
  for (size_t ring = 0; ring < by_ring.size(); ++ring) parts.local[ring] += by_ring[ring];
  noise_mm2_.clear();
  for (size_t m = 0; m < now->noise_mm2.size(); ++m) {
    const Mat3 frame = spectrum->FrameOf(static_cast<int>(m)).cast<double>();
    const size_t paths = now->noise_mm2.size() / by_ring.size();
    noise_mm2_.emplace_back(frame * by_ring[m / paths] * frame.transpose());
  }
  const int columns = mechanics_.columns() / spectrum->groups();
  const double force_n = kForceN * mechanics_.force_unit();
  LoadCases cases;
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    if (site % mechanics_.columns() >= columns) continue;
    for (const auto direction : {Linearization::kInward, Linearization::kAround, Linearization::kAlong}) {
      cases.Begin();
      cases.Add(site, force_n * untouched.skin.ForceAt(direction, site));
    }
  }
  const Eigen::Index before = parts.columns.cols();
  parts.columns.conservativeResize(Eigen::NoChange, before + cases.count());
  parts.columns.rightCols(cases.count()) = untouched.skin.Displacements(cases);
  covariance_ = RingCovariance::Make(spectrum, parts);
  return covariance_ != nullptr;
}

std::optional<double> GrossErrorTest::Chi2PerDof(const SkinProblem& problem, const Tangent& untouched) {
  if (!Prepare(untouched)) return std::nullopt;
  const double unseen_mm = prepared_for_->unseen_mm;
  const Eigen::VectorXd& untouched_mm = problem.untouched.markers_mm;
  const Eigen::MatrixXf worse = ColumnsOfWorse(problem.observed, noise_mm2_, unseen_mm);
  Eigen::MatrixXd modes;
  camera_modes_.Write(problem.observed, modes);
  const Eigen::MatrixXd known = untouched.skin.by_known_loads() * problem.prior.now;
  const Eigen::MatrixXd& baseline = problem.prior.baseline_mm;  // without rows, if it is known
  Eigen::MatrixXf columns(untouched_mm.size(), worse.cols() + modes.cols() + known.cols() + baseline.cols());
  columns.leftCols(worse.cols()) = worse;
  columns.middleCols(worse.cols(), modes.cols()) = modes.cast<float>();
  columns.middleCols(worse.cols() + modes.cols(), known.cols()) = known.cast<float>();
  if (baseline.cols() > 0) columns.rightCols(baseline.cols()) = baseline.cast<float>();
  if (!whitening_.Set(covariance_, std::move(columns))) return std::nullopt;
  Eigen::VectorXd off_mm = Eigen::VectorXd::Zero(untouched_mm.size());
  Eigen::Index seen = 0;
  for (size_t m = 0; m < problem.observed.information.size(); ++m) {
    const SeenNoise as_seen = SeenNoiseOf(problem.observed.information[m], unseen_mm);
    if (as_seen.axes.cols() == 0) continue;
    const auto at = 3 * static_cast<Eigen::Index>(m);
    const Vec3 off = problem.observed.displacement_mm[m] - untouched_mm.segment<3>(at);
    for (Eigen::Index i = 0; i < as_seen.axes.cols(); ++i)
      off_mm.segment<3>(at) += as_seen.axes.col(i).dot(off) * as_seen.axes.col(i);
    seen += as_seen.axes.cols();
  }
  return whitening_.Applied(off_mm).squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, seen));
}

bool GrossErrorTest::Fails(const SkinProblem& problem, const Tangent& untouched) {
  const std::optional<double> chi2 = Chi2PerDof(problem, untouched);
  if (!chi2) return false;
  double furthest_mm = 0;
  for (size_t m = 0; m < problem.observed.information.size(); ++m) {
    if (problem.observed.information[m].isZero()) continue;
    const auto at = 3 * static_cast<Eigen::Index>(m);
    const Vec3 off = problem.observed.displacement_mm[m] - problem.untouched.markers_mm.segment<3>(at);
    furthest_mm = std::max(furthest_mm, off.norm());
  }
  const double beyond_mm = std::max(0.0, furthest_mm / mechanics_.length_unit() - kLinearMm);
  return *chi2 > kMostChi2 + kMostChi2PerMm * beyond_mm;
}

}  // namespace taclink
