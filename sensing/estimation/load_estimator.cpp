#include "sensing/estimation/load_estimator.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "sensing/estimation/camera_noise.h"
#include "sensing/mechanics/dense.h"

namespace taclink {
namespace {

// Found on three-dimensional solids (docs/calculix.md); forces and lengths in SkinMechanics' units.
constexpr double kSparsity = 1.5;  // of a load's norm: a load explains so many standard deviations
constexpr int kReweightings = 2;
constexpr double kHillN = 0.02;    // the sparsity halves where so much acts nearby
constexpr double kEndNorm = 1.0;   // of the median: beyond the markers loads hardly show
constexpr size_t kMostHills = 24;  // no scene that was ever compared with the truth has a third of it
constexpr double kLeastOfPeak = 0.03;
constexpr double kRefitSparsity = 0.1, kRefitEndSparsity = 1.0;
constexpr double kHessianRidge = 1e-9;
constexpr double kUnseenMm = 30;  // standard deviation of a direction that is not seen, in units of length
constexpr double kSameNoise = 2;  // ratio of standard deviations
constexpr double kSameDirection = 0.9999;  // cosine

// Lower half of c := c + a a^T, of few columns.
void AddOuter(const Eigen::MatrixXd& a, Eigen::MatrixXd& c) {
  c.selfadjointView<Eigen::Lower>().rankUpdate(a);
}

}  // namespace

LoadEstimator::LoadEstimator(const SkinMechanics& mechanics, const Neighborhoods& near)
    : mechanics_(mechanics),
      near_(near),
      covariance_(mechanics, near),
      camera_modes_(mechanics.model()),
      hills_(mechanics) {}

bool LoadEstimator::Prepare(const Linearization& skin, const InflatedSkin& inflated,
                            const MarkerObservations& observed, const PressurePrior& prior,
                            const Eigen::VectorXd& local_n) {
  const int markers = mechanics_.marker_count();
  pressure_sigma_ = prior.sigma_mpa;
  by_pressure_ = prior.sigma_mpa * skin.by_pressure();
  covariance_.WriteDirect(skin, inflated, covariance_mm2_);
  baseline_sigma_ = prior.baseline_sigma_mpa;
  by_baseline_.setZero(by_pressure_.size());
  if (prior.baseline_mm_per_mpa.size() == by_pressure_.size())
    by_baseline_ = prior.baseline_sigma_mpa * prior.baseline_mm_per_mpa;
  AddOuter(by_baseline_, covariance_mm2_);
  camera_modes_.Write(observed, camera_modes_mm_);
  AddOuter(camera_modes_mm_, covariance_mm2_);
  AddOuter(covariance_.bow_mm(), covariance_mm2_);
  direct_mm2_ = covariance_mm2_.cast<float>();
  direct_mm2_.triangularView<Eigen::StrictlyUpper>() = direct_mm2_.transpose();
  covariance_.AddStray(skin, local_n, covariance_mm2_);
  AddOuter(by_pressure_, covariance_mm2_);
  noise_mm2_.resize(static_cast<size_t>(markers));
  model_covariance_.resize(noise_mm2_.size());
  for (int m = 0; m < markers; ++m) {
    const auto i = static_cast<size_t>(m);
    auto block = covariance_mm2_.block<3, 3>(3 * m, 3 * m);
    model_covariance_[i] = block.selfadjointView<Eigen::Lower>();
    // All markers together tell what is alike in all; one by one they would hide a wrong marker in it.
    const auto modes_mm = camera_modes_mm_.middleRows<3>(3 * m);
    model_covariance_[i].noalias() -= modes_mm * modes_mm.transpose();
    const auto bow_mm = covariance_.bow_mm().segment<3>(3 * m);
    model_covariance_[i].noalias() -= bow_mm * bow_mm.transpose();
    noise_mm2_[i] = NoiseOf(observed.information[i], kUnseenMm * mechanics_.length_unit());
    block += noise_mm2_[i];
  }
  // In double: a marker that one camera sees has variances that are a million times apart.
  Eigen::MatrixXd factor = covariance_mm2_;
  if (!dense::Cholesky(factor)) return false;
  factor_ = factor.cast<float>();
  WriteCameraCovariances();
  whitened_pressure_ = factor.triangularView<Eigen::Lower>().solve(by_pressure_);
  SpreadColumns(skin);
  hidden_.resize(0, 0);
  limits_.by_site_n.resize(0);
  dense::SolveLower(factor_, columns_);
  dense::Gram(columns_, gram_);
  gram_.triangularView<Eigen::StrictlyUpper>() = gram_.transpose();
  regions_.clear();
  return columns_.allFinite();
}

// Of M m with independent m ~ N(0, 1): what all markers leave of it, M (I - M' covariance^-1 M) M'.
void LoadEstimator::WriteCameraCovariances() {
  Eigen::MatrixXf whitened = camera_modes_mm_.cast<float>();
  dense::SolveLower(factor_, whitened);
  const Eigen::Index modes = camera_modes_mm_.cols();
  const Eigen::MatrixXd left =
      Eigen::MatrixXd::Identity(modes, modes) - (whitened.transpose() * whitened).cast<double>();
  camera_covariance_.resize(noise_mm2_.size());
  for (size_t m = 0; m < camera_covariance_.size(); ++m) {
    const auto modes_mm = camera_modes_mm_.middleRows<3>(3 * static_cast<Eigen::Index>(m));
    camera_covariance_[m] = modes_mm * left * modes_mm.transpose();
  }
}

// Behind the sites' columns, those of bands: of 1 N that a row of sites shares.
void LoadEstimator::SpreadColumns(const Linearization& skin) {
  Eigen::MatrixXf at_nodes(factor_.rows(), mechanics_.site_count());
  for (int site = 0; site < mechanics_.site_count(); ++site)
    at_nodes.col(site) = skin.Column(Linearization::kInward, site);
  columns_.resize(at_nodes.rows(), at_nodes.cols() + mechanics_.site_rows());
  Eigen::VectorXf sum(at_nodes.rows());
  for (Eigen::Index site = 0; site < at_nodes.cols(); ++site) {
    sum.setZero();
    for (Eigen::SparseMatrix<double>::InnerIterator it(mechanics_.spread(), site); it; ++it)
      sum += static_cast<float>(it.value()) * at_nodes.col(it.row());
    columns_.col(site) = sum;
  }
  const int around = mechanics_.columns();
  for (int row = 0; row < mechanics_.site_rows(); ++row)
    columns_.col(at_nodes.cols() + row) = columns_.middleCols(row * around, around).rowwise().mean();
}

bool LoadEstimator::IsPreparedFor(const MarkerObservations& observed, const PressurePrior& prior) const {
  if (noise_mm2_.empty() || prior.sigma_mpa > kSameNoise * pressure_sigma_ ||
      pressure_sigma_ > kSameNoise * prior.sigma_mpa)
    return false;
  constexpr double kSameMm = 1e-6;
  const Eigen::VectorXd& baseline = prior.baseline_mm_per_mpa;
  const bool is_same_baseline = baseline.size() == by_baseline_.size()
                                    ? (prior.baseline_sigma_mpa * baseline - by_baseline_).isZero(kSameMm)
                                    : by_baseline_.isZero(kSameMm);
  if (!is_same_baseline) return false;
  const double unseen = kUnseenMm * mechanics_.length_unit(), unseen2 = unseen * unseen;
  constexpr double kMost = kSameNoise * kSameNoise, kNewlySeenShare = 0.02;
  int worse = 0;
  for (size_t m = 0; m < noise_mm2_.size(); ++m) {
    const double then = noise_mm2_[m].trace(), now = NoiseTraceOf(observed.information[m], unseen);
    if (now > 0.3 * unseen2) continue;  // in a direction at least, which is hidden
    if (then > 0.3 * unseen2 || now > kMost * then || then > kMost * now) ++worse;
  }
  return worse <= kNewlySeenShare * static_cast<double>(noise_mm2_.size());
}

Eigen::MatrixXd LoadEstimator::Whitened(const Eigen::MatrixXd& columns) const {
  Eigen::MatrixXf single = columns.cast<float>();
  dense::SolveLower(factor_, single);
  return single.cast<double>();
}

// What was seen when all was prepared and is not seen now is unknown: its unit vectors, whitened, are
// projected out of data and columns, which is the same as leaving these rows out.
void LoadEstimator::Hide(const MarkerObservations& observed) {
  const double unseen = kUnseenMm * mechanics_.length_unit(), unseen2 = unseen * unseen;
  std::vector<Direction>& missing = missing_now_;
  missing.clear();
  is_shown_.assign(static_cast<size_t>(3 * mechanics_.marker_count()), 1);
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const Mat3& information = observed.information[i];
    if (IsSurelySeen(information, 1 / (0.3 * unseen2))) continue;
    Eigen::SelfAdjointEigenSolver<Mat3> modes;
    if (!information.allFinite() || information.isZero())
      modes.computeDirect(Mat3::Zero());
    else
      modes.computeDirect(information);
    for (int a = 0; a < 3; ++a) {
      if (modes.eigenvalues()[a] > 1 / (0.3 * unseen2)) continue;
      const Vec3 direction = modes.eigenvectors().col(a);
      for (int c = 0; c < 3; ++c) {
        if (std::abs(direction[c]) > 0.3) is_shown_[static_cast<size_t>(3 * m + c)] = 0;
      }
      if (direction.dot(noise_mm2_[i] * direction) < 0.3 * unseen2) missing.emplace_back(3 * m, direction);
    }
  }
  // What a body hides stays hidden while it stands there.
  const auto is_same = [](const Direction& a, const Direction& b) {
    return a.first == b.first && std::abs(a.second.dot(b.second)) > kSameDirection;
  };
  if (hidden_.rows() == factor_.rows() &&
      std::equal(missing.begin(), missing.end(), missing_.begin(), missing_.end(), is_same))
    return;
  missing_ = missing;
  limits_.by_site_n.resize(0);
  is_hidden_projected_ = false;
  hidden_.setZero(factor_.rows(), static_cast<Eigen::Index>(missing.size()));
  for (size_t k = 0; k < missing.size(); ++k)
    hidden_.block<3, 1>(missing[k].first, static_cast<Eigen::Index>(k)) = missing[k].second;
  hidden_ = Whitened(hidden_);
  if (hidden_.cols() > 0) {
    // Orthonormal by Cholesky of its Gram matrix, which is well conditioned.
    Eigen::MatrixXd gram;
    dense::TransposedProduct(hidden_, hidden_, gram);
    const Eigen::LLT<Eigen::MatrixXd> llt(gram);
    llt.matrixU().solveInPlace<Eigen::OnTheRight>(hidden_);
  }
}

// Frees data and Gram matrix of what is hidden.
void LoadEstimator::ProjectOut(const Eigen::MatrixXd& tangential) {
  Eigen::VectorXd shrink = Eigen::VectorXd::Ones(hidden_.cols() + tangential.cols());
  Eigen::MatrixXd basis(factor_.rows(), shrink.size());
  basis.leftCols(hidden_.cols()) = hidden_;
  if (tangential.cols() > 0) {
    // A tangential force has a prior, so that its columns shrink and do not vanish.
    Eigen::MatrixXd free = tangential;
    if (hidden_.cols() > 0) free -= hidden_ * (hidden_.transpose() * free);
    free *= TangentialPrior(tangential.cols()).cwiseSqrt().cwiseInverse().asDiagonal();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(free, Eigen::ComputeThinU);
    basis.rightCols(tangential.cols()) = svd.matrixU();
    const auto scaled = svd.singularValues().array().square();
    shrink.tail(tangential.cols()) = scaled / (1 + scaled);
  }
  frame_data_ = data_;
  frame_gram_ = &gram_;
  if (basis.cols() == 0) return;
  frame_data_ -= basis * (shrink.asDiagonal() * (basis.transpose() * data_));
  frame_gram_ = &free_gram_;
  if (is_hidden_projected_ && tangential.cols() == 0) return;
  is_hidden_projected_ = tangential.cols() == 0;
  dense::TransposedProduct(basis.cast<float>(), columns_, hidden_columns_);
  const Eigen::MatrixXf scaled = shrink.cast<float>().asDiagonal() * hidden_columns_;
  free_gram_ = gram_;
  dense::AddTransposedProduct(-1, hidden_columns_, scaled, free_gram_);
}

// Loads of all sites, and of bands all around, under a penalty that fades where much acts, grouped. What a
// band does to an inflated skin is little beside what each of its sites would do alone, so that it would not
// pay for theirs.
std::vector<LoadEstimator::Hill> LoadEstimator::Select(const Linearization& skin) {
  const int sites = mechanics_.site_count(), around = mechanics_.columns();
  const double unit = mechanics_.force_unit();
  Eigen::VectorXf target(columns_.cols());
  dense::TransposedProduct(columns_, frame_data_.cast<float>(), target);
  target_ = target.cast<double>();
  // Of a site of which hardly anything shows, what is left of its column is rounding.
  norms_ = frame_gram_->diagonal().cwiseMax(kRounding * gram_.diagonal()).cast<double>().cwiseSqrt();
  Eigen::VectorXd sorted = norms_.head(sites);
  std::nth_element(sorted.data(), sorted.data() + sites / 2, sorted.data() + sites);
  usual_norm_ = sorted[sites / 2];
  for (int site = 0; site < sites; ++site) {
    if (mechanics_.IsBeyondMarkers(site)) norms_[site] = std::max(norms_[site], kEndNorm * usual_norm_);
  }
  Eigen::VectorXd sparsity = kSparsity * norms_;
  sparsity.tail(mechanics_.site_rows()) *= kBandSparsity / kSparsity;
  std::vector<int>& chosen = chosen_;
  weights_ = sparsity;
  const bool is_cold = chosen.empty();
  const Eigen::VectorXd* found = &solver_.Solve(*frame_gram_, target_ - weights_, chosen);
  // Those of the last step are a good guess. The minimum does not depend on it, but the solver may give up on
  // the way from there.
  if (!solver_.converged() && !is_cold) {
    chosen.clear();
    found = &solver_.Solve(*frame_gram_, target_ - weights_, chosen);
  }
  is_selected_ = solver_.converged();
  ShareBands(*found, chosen);
  for (int pass = 0; pass < kReweightings && !chosen.empty(); ++pass) {
    Eigen::VectorXd near = Eigen::VectorXd::Zero(norms_.size());
    for (int site = 0; site < sites; ++site) {
      if (loads_[site] > 0) near.head(sites) += loads_[site] * near_.load_sites.col(site);
    }
    for (Eigen::Index band = sites; band < near.size(); ++band)
      near[band] = near.segment((band - sites) * around, around).mean();
    weights_ = sparsity.array() / (1 + near.array() / (kHillN * unit));
    ShareBands(solver_.Solve(*frame_gram_, target_ - weights_, chosen), chosen);
    is_selected_ = is_selected_ && solver_.converged();
  }
  if (!is_selected_) chosen.clear();
  std::vector<int> support;
  for (int site = 0; site < sites; ++site) {
    if (loads_[site] > 0) support.push_back(site);
  }
  std::vector<Hill> hills = hills_.Find(skin, loads_, support);
  std::erase_if(hills, [&](const Hill& hill) {
    double sum = 0;
    for (const int site : hill) sum += loads_[site];
    return sum < kLeastHillN * unit;
  });
  for (Hill& hill : hills) {
    double peak = 0;
    for (const int site : hill) peak = std::max(peak, loads_[site]);
    std::erase_if(hill, [&](int site) { return loads_[site] <= kLeastOfPeak * peak; });
  }
  return hills;
}

// What all hills but one explain, without penalty.
LoadEstimator::Explanation LoadEstimator::Explain(const std::vector<Hill>& hills, size_t without) {
  std::vector<int> columns;
  for (size_t i = 0; i < hills.size(); ++i) {
    if (i != without) columns.insert(columns.end(), hills[i].begin(), hills[i].end());
  }
  const double all = frame_data_.dot(data_);
  if (columns.empty()) return {.chi2 = all, .loads = {}};
  const Eigen::MatrixXd exact = (*frame_gram_)(columns, columns).cast<double>();
  Eigen::MatrixXd h = exact;
  h.diagonal().array() += kRounding * h.trace() / static_cast<double>(columns.size());
  const Eigen::VectorXd b = target_(columns);
  std::vector<int> support;
  const Eigen::VectorXd& x = solver_.Solve(h, b, support);
  return {.chi2 = all - 2 * b.dot(x) + x.dot(exact * x), .loads = x};
}

void LoadEstimator::Eliminate(std::vector<Hill>& hills) {
  double now = Explain(hills, hills.size()).chi2;
  while (!hills.empty()) {
    double least = 0;
    size_t weakest = hills.size();
    for (size_t i = 0; i < hills.size(); ++i) {
      const double gain = Explain(hills, i).chi2 - now;
      if (weakest < hills.size() && gain >= least) continue;
      least = gain;
      weakest = i;
    }
    if (least > kHillGain) return;
    hills.erase(hills.begin() + static_cast<std::ptrdiff_t>(weakest));
    now += least;
  }
}

// Loads of the chosen columns almost without penalty, for that makes all of them too small; tangential forces
// are eliminated from the problem.
LoadEstimator::Solution LoadEstimator::Refit(const std::vector<int>& chosen,
                                             const Eigen::MatrixXd& tangential) {
  const auto n = static_cast<Eigen::Index>(chosen.size());
  Eigen::MatrixXd normal = columns_(Eigen::all, chosen).cast<double>();
  Eigen::VectorXd data = data_;
  if (hidden_.cols() > 0) {
    normal -= hidden_ * (hidden_.transpose() * normal);
    data -= hidden_ * (hidden_.transpose() * data);
  }
  const Eigen::VectorXd prior = TangentialPrior(tangential.cols());
  Eigen::MatrixXd h;
  dense::TransposedProduct(normal, normal, h);
  Eigen::VectorXd b = normal.transpose() * data;
  Eigen::LLT<Eigen::MatrixXd> inner;
  if (tangential.cols() > 0) {
    Eigen::MatrixXd g = tangential.transpose() * tangential;
    g.diagonal() += prior;
    inner.compute(g);
    Eigen::MatrixXd cross;
    dense::TransposedProduct(tangential, normal, cross);
    const Eigen::MatrixXd solved = inner.solve(cross);
    h -= cross.transpose() * solved;
    b -= solved.transpose() * (tangential.transpose() * data);
  }
  const double unit = mechanics_.force_unit();
  Eigen::VectorXd near_n = Eigen::VectorXd::Zero(mechanics_.site_count());
  for (const int column : chosen)
    ForSites(column, [&](int from, double) { near_n += loads_[from] * near_.load_sites.col(from); });
  for (Eigen::Index i = 0; i < n; ++i) {
    const int column = chosen[static_cast<size_t>(i)];
    double near_column_n = 0;
    ForSites(column, [&](int site, double share) { near_column_n += share * near_n[site]; });
    const double norm = std::sqrt(std::max(h(i, i), 0.0));
    b[i] -= kRefitSparsity * norm / (1 + near_column_n / (kHillN * unit));
    if (!IsBand(column) && mechanics_.IsBeyondMarkers(column))
      b[i] -= kRefitEndSparsity * std::max(kEndNorm * usual_norm_ - norm, 0.0);
  }
  h.diagonal().array() += kHessianRidge * h.trace() / static_cast<double>(n);
  Solution solution;
  std::vector<int> support;
  solution.loads = solver_.Solve(h, b, support);
  solution.converged = solver_.converged();
  solution.residual = data - normal * solution.loads;
  if (tangential.cols() > 0) {
    solution.tangential = inner.solve(tangential.transpose() * solution.residual);
    solution.residual -= tangential * solution.tangential;
  }
  solution.chi2 = solution.residual.squaredNorm() + prior.dot(solution.tangential.cwiseAbs2());
  return solution;
}

void LoadEstimator::Fit(Linearization& skin, const MarkerObservations& observed, LoadEstimate& estimate) {
  estimate = {};
  Eigen::VectorXd data = Eigen::VectorXd::Zero(factor_.rows());
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const bool seen = observed.information[i].trace() > 0 && observed.displacement_mm[i].allFinite();
    if (seen) data.segment<3>(3 * m) = observed.displacement_mm[i] - skin.base_mm().segment<3>(3 * m);
  }
  data_ = Whitened(data);
  Hide(observed);
  std::vector<Hill> hills;
  std::vector<int> slipping;  // hills with a tangential force, in the order of their columns
  Eigen::MatrixXd tangential(data_.size(), 0);
  // With tangential forces in, the selection is made once more with these taken as unknown.
  for (int stage = 0; stage < 2; ++stage) {
    ProjectOut(tangential);
    const Eigen::VectorXd loads_before = loads_;
    std::vector<Hill> found = Select(skin);
    estimate.converged = is_selected_ && found.size() <= kMostHills;
    if (!estimate.converged) return;
    Eliminate(found);
    JoinHugs(found);
    if (found.empty() && stage > 0) {
      // Bodies that hardly press, but drag: what is left beside their pull does not tell where they are.
      loads_ = loads_before;
      break;
    }
    hills = std::move(found);
    if (hills.empty()) {
      solution_ = {.loads = {}, .tangential = {}, .residual = data_, .chi2 = 0, .converged = true};
      if (hidden_.cols() > 0) solution_.residual -= hidden_ * (hidden_.transpose() * data_);
      solution_.chi2 = solution_.residual.squaredNorm();
      break;
    }
    LetSlip(skin, hills, slipping, tangential, solution_);
    if (slipping.empty()) break;
  }
  estimate.converged = solution_.converged;
  if (!estimate.converged) return;
  Finish(skin, hills, slipping, estimate);
}

}  // namespace taclink
