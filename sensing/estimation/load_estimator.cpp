#include "sensing/estimation/load_estimator.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "sensing/estimation/camera_noise.h"
#include "sensing/estimation/site_columns.h"
#include "sensing/shell/dense.h"

namespace taclink {
namespace {

// Found on three-dimensional solids (docs/reports/calculix.md); forces and lengths in SkinMechanics' units.
constexpr double kSparsity = 1.5;  // of a load's norm: a load explains so many standard deviations
constexpr int kReweightings = 2;
constexpr double kHillN = 0.02;    // the sparsity halves where so much acts nearby
constexpr double kEndNorm = 1.0;   // of the median: beyond the markers loads hardly show
constexpr size_t kMostHills = 24;  // no scene that was ever compared with the truth has a third of it
constexpr double kLeastOfPeak = 0.03;
constexpr double kRefitSparsity = 0.1, kRefitEndSparsity = 1.0;
constexpr double kHessianRidge = 1e-9;
// Columns are made where a third as much presses nearby as where most does; and, of loads that explain so
// many standard deviations by themselves (less than a contact has to: kHillGain), of some at once with those
// about them. After some rounds of it, of all.
constexpr double kLikelyShare = 0.3, kLetInNorm = 3, kAbout = 0.3;
constexpr size_t kMostLetIn = 8;
constexpr int kMostRounds = 4;
constexpr int kMostTrials = 1500;          // of a fit: the most that a right answer ever took is 1,137
constexpr double kSameDirection = 0.9999;  // cosine

}  // namespace

LoadEstimator::LoadEstimator(const SkinMechanics& mechanics, const Neighborhoods& near)
    : mechanics_(mechanics),
      near_(near),
      covariance_(mechanics, near),
      camera_modes_(mechanics.model()),
      hills_(mechanics) {
  const LinkModel& model = mechanics.model();
  const int paths = model.markers.paths, rings = model.markers.rings();
  for (int marker = 0; marker < model.markers.count(); ++marker) {
    const int path = model.PathOf(marker), ring = model.RingOf(marker);
    if (path % 2 != 0) continue;
    std::vector<int>& region = regions_.emplace_back();
    for (int r = std::max(0, ring - 1); r <= std::min(rings - 1, ring + 1); ++r) {
      for (int p = path - 1; p <= path + 1; ++p) region.push_back(model.MarkerIndex((p + paths) % paths, r));
    }
    std::ranges::sort(region);
  }
}

bool LoadEstimator::Prepare(Linearization& skin, const UntouchedSkin& untouched_skin,
                            const MarkerObservations& observed, const KnownLoadsPrior& prior,
                            const Eigen::VectorXd& local_n,
                            std::shared_ptr<const UntouchedCovariance> untouched) {
  const bool is_touched = untouched != nullptr;
  covariance_.SetState(skin, untouched_skin);
  untouched_ =
      is_touched ? std::move(untouched) : UntouchedCovariance::Make(skin, covariance_, observed, prior);
  if (!untouched_) return false;
  known_errors_ = prior.now;
  by_known_loads_ = skin.by_known_loads() * known_errors_;
  const Eigen::MatrixXf of_loads = covariance_.ColumnsOfLoads(skin, local_n, untouched_->stray_mm_per_n,
                                                              untouched_->usual_noise_mm),
                        of_noise = ColumnsOfNoise(observed);
  camera_modes_.Write(observed, camera_modes_mm_);
  const Eigen::MatrixXd& of_baseline = untouched_->by_baseline_mm;
  model_columns_ = of_loads.cols() + of_baseline.cols();
  Eigen::MatrixXf more(of_loads.rows(),
                       model_columns_ + of_noise.cols() + camera_modes_mm_.cols() + known_errors_.cols());
  more << of_loads, of_baseline.cast<float>(), of_noise, camera_modes_mm_.cast<float>(),
      by_known_loads_.cast<float>();
  if (!whitening_.Set(untouched_->factored, std::move(more))) return false;
  model_covariance_.clear();
  whitened_known_loads_ = whitening_.Applied(by_known_loads_);
  hidden_.resize(0, 0);
  free_norms_.resize(0);
  limits_.by_site_n.resize(0);
  tangential_ = {};
  hidden_projected_ = 0;
  columns_.Clear(mechanics_.site_count() + mechanics_.site_rows(), whitening_.size());
  if (!is_touched && untouched_->ring)
    MakeRotatedColumns(skin);
  else
    MakeColumns(skin, LikelyLoads(is_touched ? local_n : Eigen::VectorXd()));
  return columns_.columns().allFinite();
}

// By marker, of the model's error and the cameras' motion: once for each Prepare, when the first frame comes
// to its end.
void LoadEstimator::WriteMarkerCovariances() {
  if (!model_covariance_.empty()) return;
  WriteModelCovariances();
  WriteCameraCovariances();
  region_factors_.assign(regions_.size(), std::nullopt);
}

// All markers together tell what is alike in all; one by one they would hide a wrong marker in it: without
// the cameras' motion and the bow.
void LoadEstimator::WriteModelCovariances() {
  model_covariance_ = untouched_->marker_mm2;
  for (size_t m = 0; m < model_covariance_.size(); ++m) {
    const auto all = whitening_.columns().middleRows<3>(3 * static_cast<Eigen::Index>(m));
    const auto of_loads = all.leftCols(model_columns_);
    const auto of_known = all.rightCols(known_errors_.cols());
    model_covariance_[m] +=
        Mat3((of_loads * of_loads.transpose() + of_known * of_known.transpose()).cast<double>());
  }
}

// Where much presses nearby, or all around; all, without local forces.
std::vector<int> LoadEstimator::LikelyLoads(const Eigen::VectorXd& local_n) const {
  const double least_n = local_n.size() > 0 ? kLikelyShare * local_n.maxCoeff() : 0;
  std::vector<int> loads;
  for (int load = 0; load < mechanics_.site_count() + mechanics_.site_rows(); ++load) {
    if (local_n.size() == 0 || MeanOver(load, local_n) > least_n) loads.push_back(load);
  }
  return loads;
}

double LoadEstimator::MeanOver(int column, const Eigen::VectorXd& by_site) const {
  double sum = 0;
  ForSites(column, [&](int site, double share) { sum += share * by_site[site]; });
  return sum;
}

// Of loads that have none yet: of 1 N at a site, or that a row of sites shares.
void LoadEstimator::MakeColumns(const Linearization& skin, std::vector<int> loads) {
  std::sort(loads.begin(), loads.end());
  loads.erase(std::unique(loads.begin(), loads.end()), loads.end());
  std::erase_if(loads, [&](int load) { return columns_.Has(load); });
  if (loads.empty()) return;
  Eigen::MatrixXf made = InwardColumns(mechanics_, skin, loads);
  whitening_.Apply(made);
  columns_.Append(loads, made);
}

// While a frame is fitted.
void LoadEstimator::AddColumns(const Linearization& skin, std::vector<int> loads) {
  MakeColumns(skin, std::move(loads));
  if (columns_.columns().cols() != target_.size()) WriteFrameGram();
}

// Those of all loads of a skin of revolution. Whitening::Finish subtracts the low-rank part (camera motion,
// baseline, known loads), which is not invariant under rotation.
void LoadEstimator::MakeRotatedColumns(const Linearization& skin) {
  RotatedColumns all(mechanics_, *untouched_->ring, skin);
  const Eigen::MatrixXf explained = whitening_.Finish(all.whitened);
  if (explained.rows() > 0) dense::AddTransposedProduct(-1, explained, explained, all.gram);
  all.gram.triangularView<Eigen::StrictlyUpper>() = all.gram.transpose();
  columns_.Set(all.loads, std::move(all.whitened), std::move(all.gram));
}

// Of M m with independent m ~ N(0, 1): what all markers leave of it, M (I - M' covariance^-1 M) M'.
void LoadEstimator::WriteCameraCovariances() {
  const Eigen::MatrixXd& all_mm = camera_modes_mm_;
  const Eigen::MatrixXd whitened = whitening_.Applied(all_mm);
  const Eigen::MatrixXd left =
      Eigen::MatrixXd::Identity(all_mm.cols(), all_mm.cols()) - whitened.transpose() * whitened;
  camera_covariance_.resize(model_covariance_.size());
  for (size_t m = 0; m < camera_covariance_.size(); ++m) {
    const auto modes_mm = all_mm.middleRows<3>(3 * static_cast<Eigen::Index>(m));
    camera_covariance_[m] = modes_mm * left * modes_mm.transpose();
  }
}

bool LoadEstimator::HasKnownLoads(const KnownLoadsPrior& prior) const {
  return untouched_ && prior.IsAbout(known_errors_);
}

bool LoadEstimator::IsPreparedFor(const MarkerObservations& observed, const KnownLoadsPrior& prior) const {
  if (!HasKnownLoads(prior) || !untouched_->HasBaseline(prior) || !untouched_->LosesFew(observed))
    return false;
  constexpr double kMost = kSameNoise * kSameNoise;
  int worse = 0;
  for (size_t m = 0; m < noise_mm2_.size(); ++m) {
    // What is hidden now does not matter.
    const auto [then, now] = ChangeOf(noise_mm2_[m], observed.information[m], covariance_.unseen_mm());
    if (now > kMost * then || then > kMost * now) ++worse;
  }
  return worse <= kOtherNoiseShare * static_cast<double>(noise_mm2_.size());
}

// Of markers that cameras see worse now than when the untouched skin's covariance was made: the noise that is
// more, a column for each direction in which they are seen.
Eigen::MatrixXf LoadEstimator::ColumnsOfNoise(const MarkerObservations& observed) {
  noise_mm2_ = untouched_->noise_mm2;
  Eigen::MatrixXf columns(by_known_loads_.rows(), 0);
  for (size_t m = 0; m < noise_mm2_.size(); ++m) {
    const SeenNoise now = SeenNoiseOf(observed.information[m], covariance_.unseen_mm());
    const Eigen::MatrixXd then_mm2 = now.axes.transpose() * noise_mm2_[m] * now.axes;
    if ((now.variances_mm2.array() <= kSameNoise * kSameNoise * then_mm2.diagonal().array()).all()) continue;
    Eigen::MatrixXd more_mm2 = -then_mm2;
    more_mm2.diagonal() += now.variances_mm2;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> more(more_mm2);
    const Eigen::MatrixXd root =
        now.axes * more.eigenvectors() * more.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
    columns.conservativeResize(Eigen::NoChange, columns.cols() + root.cols());
    columns.rightCols(root.cols()).setZero();
    columns.block(3 * static_cast<Eigen::Index>(m), columns.cols() - root.cols(), 3, root.cols()) =
        root.cast<float>();
    noise_mm2_[m] += root * root.transpose();
  }
  return columns;
}

bool LoadEstimator::AreSame(const std::vector<Direction>& a, const std::vector<Direction>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Direction& one, const Direction& other) {
    return one.first == other.first && std::abs(one.second.dot(other.second)) > kSameDirection;
  });
}

// What was seen when all was prepared and is not seen now is unknown: its unit vectors, whitened, are
// projected out of data and columns, which is the same as leaving these rows out.
void LoadEstimator::Hide(const MarkerObservations& observed) {
  const double unseen = covariance_.unseen_mm(), unseen2 = unseen * unseen;
  std::vector<Direction>& missing = missing_now_;
  missing.clear();
  is_shown_.assign(static_cast<size_t>(3 * mechanics_.marker_count()), 1);
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const Mat3& information = observed.information[i];
    if (IsSurelySeen(information, 1 / (kUnseenShare * unseen2))) continue;
    Eigen::SelfAdjointEigenSolver<Mat3> modes;
    if (!information.allFinite() || information.isZero())
      modes.computeDirect(Mat3::Zero());
    else
      modes.computeDirect(information);
    for (int a = 0; a < 3; ++a) {
      if (modes.eigenvalues()[a] > 1 / (kUnseenShare * unseen2)) continue;
      const Vec3 direction = modes.eigenvectors().col(a);
      for (int c = 0; c < 3; ++c) {
        if (std::abs(direction[c]) > 0.3) is_shown_[static_cast<size_t>(3 * m + c)] = 0;
      }
      if (direction.dot(noise_mm2_[i] * direction) < kUnseenShare * unseen2)
        missing.emplace_back(3 * m, direction);
    }
  }
  // What a body hides stays hidden while it stands there.
  if (hidden_.rows() == whitening_.size() && AreSame(missing, missing_)) return;
  missing_ = missing;
  limits_.by_site_n.resize(0);
  tangential_ = {};
  free_norms_.resize(0);
  hidden_projected_ = 0;
  hidden_.setZero(whitening_.size(), static_cast<Eigen::Index>(missing.size()));
  for (size_t k = 0; k < missing.size(); ++k)
    hidden_.block<3, 1>(missing[k].first, static_cast<Eigen::Index>(k)) = missing[k].second;
  hidden_ = whitening_.Applied(hidden_);
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
  shares_.setOnes(hidden_.cols() + tangential.cols());
  basis_.resize(whitening_.size(), shares_.size());
  basis_.leftCols(hidden_.cols()) = hidden_;
  if (tangential.cols() > 0) {
    // A tangential force has a prior, so that its columns shrink and do not vanish.
    Eigen::MatrixXd free = tangential;
    if (hidden_.cols() > 0) free -= hidden_ * (hidden_.transpose() * free);
    free *= TangentialPrior(tangential.cols()).cwiseSqrt().cwiseInverse().asDiagonal();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(free, Eigen::ComputeThinU);
    basis_.rightCols(tangential.cols()) = svd.matrixU();
    const auto scaled = svd.singularValues().array().square();
    shares_.tail(tangential.cols()) = scaled / (1 + scaled);
  }
  frame_data_ = Free(data_);
  WriteFrameGram();
}

Eigen::VectorXd LoadEstimator::Free(Eigen::VectorXd whitened) const {
  if (basis_.cols() > 0) whitened -= basis_ * (shares_.asDiagonal() * (basis_.transpose() * whitened));
  return whitened;
}

// Of all columns that there are, and what they say of the data.
void LoadEstimator::WriteFrameGram() {
  Eigen::VectorXf target(columns_.columns().cols());
  dense::TransposedProduct(columns_.columns(), frame_data_.cast<float>(), target);
  target_ = target.cast<double>();
  frame_gram_ = &columns_.gram();
  if (basis_.cols() == 0) return;
  frame_gram_ = &free_gram_;
  const bool is_of_hidden = basis_.cols() == hidden_.cols();
  if (is_of_hidden && hidden_projected_ == columns_.gram().cols()) return;
  hidden_projected_ = is_of_hidden ? columns_.gram().cols() : 0;
  dense::TransposedProduct(basis_.cast<float>(), columns_.columns(), hidden_columns_);
  const Eigen::MatrixXf scaled = shares_.cast<float>().asDiagonal() * hidden_columns_;
  free_gram_ = columns_.gram();
  dense::AddTransposedProduct(-1, hidden_columns_, scaled, free_gram_);
}

// By load, beside what the frame does not show. Of a site of which hardly anything shows, what is left of its
// column is rounding.
void LoadEstimator::WriteNorms(const Eigen::VectorXd* untouched_norms) {
  const int sites = mechanics_.site_count();
  if (untouched_norms != nullptr)
    norms_ = *untouched_norms;
  else
    norms_.resize(sites + mechanics_.site_rows());
  for (size_t place = 0; place < columns_.loads().size(); ++place) {
    const auto i = static_cast<Eigen::Index>(place);
    norms_[columns_.loads()[place]] =
        std::sqrt(std::max((*frame_gram_)(i, i), kRounding * columns_.gram()(i, i)));
  }
  Eigen::VectorXd sorted = norms_.head(sites);
  std::nth_element(sorted.data(), sorted.data() + sites / 2, sorted.data() + sites);
  usual_norm_ = sorted[sites / 2];
  for (int site = 0; site < sites; ++site) {
    if (mechanics_.IsBeyondMarkers(site)) norms_[site] = std::max(norms_[site], kEndNorm * usual_norm_);
  }
}

// By load; they fade where much acts nearby.
Eigen::VectorXd LoadEstimator::Penalties(const Eigen::VectorXd& near_n) const {
  Eigen::VectorXd penalties = kSparsity * norms_;
  penalties.tail(mechanics_.site_rows()) *= kBandSparsity / kSparsity;
  return penalties.array() / (1 + near_n.array() / (kHillN * mechanics_.force_unit()));
}

// Loads of the columns that there are, from those of the last time, which are a good guess. The minimum does
// not depend on it, but the solver may give up on the way from there. Sets `chosen_` and `loads_`.
void LoadEstimator::SolveSparse(const Eigen::VectorXd& near_n) {
  weights_ = Penalties(near_n);
  Eigen::VectorXd linear = target_;
  for (Eigen::Index i = 0; i < linear.size(); ++i)
    linear[i] -= weights_[columns_.loads()[static_cast<size_t>(i)]];
  std::erase_if(chosen_, [&](int load) { return !columns_.Has(load); });
  std::vector<int> places = columns_.Places(chosen_);
  const bool is_cold = places.empty();
  const Eigen::VectorXd* found = &solver_.Solve(*frame_gram_, linear, places);
  if (!solver_.converged() && !is_cold) {
    places.clear();
    found = &solver_.Solve(*frame_gram_, linear, places);
  }
  is_selected_ = solver_.converged();
  chosen_.clear();
  for (const int place : places) chosen_.push_back(columns_.loads()[static_cast<size_t>(place)]);
  found_ = (*found)(places);
  ShareBands(found_, chosen_);
}

// Makes columns of loads that would explain much of what the fit has left, and of those about them, or of
// all. Sites are priced by the adjoint solution that the stray forces come from. False: there are none.
bool LoadEstimator::LetIn(Linearization& skin, bool all) {
  std::vector<std::pair<double, int>> paying;  // standard deviations, site
  const Eigen::VectorXd pulls = mechanics_.spread().transpose() * inward_pulls_;
  std::vector<int> loads;
  for (int load = 0; load < static_cast<int>(norms_.size()); ++load) {
    const double deviations = MeanOver(load, pulls) / norms_[load];
    if (columns_.Has(load) || deviations < (IsBand(load) ? kBandSparsity : kLetInNorm)) continue;
    if (IsBand(load))
      loads.push_back(load);
    else
      paying.emplace_back(deviations, load);
  }
  if (paying.empty() && loads.empty()) return false;
  std::sort(paying.rbegin(), paying.rend());
  if (paying.size() > kMostLetIn) paying.resize(kMostLetIn);
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    const auto is_about = [&](const auto& each) { return near_.load_sites(site, each.second) > kAbout; };
    if (all || std::any_of(paying.begin(), paying.end(), is_about)) loads.push_back(site);
  }
  MakeColumns(skin, loads);
  return true;
}

// Loads of all sites, and of bands all around, under a penalty that fades where much acts, grouped. What a
// band does to an inflated skin is little beside what each of its sites would do alone, so that it would not
// pay for theirs.
std::vector<LoadEstimator::Hill> LoadEstimator::Select(Linearization& skin,
                                                       const Eigen::VectorXd* untouched_norms) {
  const int sites = mechanics_.site_count(), around = mechanics_.columns();
  const double unit = mechanics_.force_unit();
  Eigen::VectorXd near = Eigen::VectorXd::Zero(sites + mechanics_.site_rows());
  WriteNorms(untouched_norms);
  SolveSparse(near);
  for (int pass = 0; pass < kReweightings && is_selected_ && !chosen_.empty(); ++pass) {
    near.setZero();
    for (int site = 0; site < sites; ++site) {
      if (loads_[site] > 0) near_.load_sites.AddTo(near.head(sites), site, loads_[site]);
    }
    for (Eigen::Index band = sites; band < near.size(); ++band)
      near[band] = near.segment((band - sites) * around, around).mean();
    SolveSparse(near);
  }
  if (!is_selected_) chosen_.clear();
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
  std::vector<int> in_hills;
  for (Hill& hill : hills) {
    double peak = 0;
    for (const int site : hill) peak = std::max(peak, loads_[site]);
    std::erase_if(hill, [&](int site) { return loads_[site] <= kLeastOfPeak * peak; });
    in_hills.insert(in_hills.end(), hill.begin(), hill.end());
  }
  AddColumns(skin, std::move(in_hills));  // a band's sites may have none yet
  return hills;
}

// What all hills but one explain, without penalty.
LoadEstimator::Explanation LoadEstimator::Explain(const std::vector<Hill>& hills, size_t without) {
  ++trials_;
  std::vector<int> columns;
  for (size_t i = 0; i < hills.size(); ++i) {
    if (i != without) columns.insert(columns.end(), hills[i].begin(), hills[i].end());
  }
  const double all = frame_data_.dot(data_);
  if (columns.empty()) return {.chi2 = all, .loads = {}};
  const std::vector<int> places = columns_.Places(columns);
  const Eigen::MatrixXd exact = (*frame_gram_)(places, places).cast<double>();
  Eigen::MatrixXd h = exact;
  h.diagonal().array() += kRounding * h.trace() / static_cast<double>(columns.size());
  const Eigen::VectorXd b = target_(places);
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
  Eigen::MatrixXd normal = columns_.columns()(Eigen::all, columns_.Places(chosen)).cast<double>();
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
    ForSites(column, [&](int from, double) { near_.load_sites.AddTo(near_n, from, loads_[from]); });
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

void LoadEstimator::SetData(const Linearization& skin, const MarkerObservations& observed) {
  Eigen::VectorXd data = Eigen::VectorXd::Zero(whitening_.size());
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const bool seen = observed.information[i].trace() > 0 && observed.displacement_mm[i].allFinite();
    if (seen) data.segment<3>(3 * m) = observed.displacement_mm[i] - skin.base_mm().segment<3>(3 * m);
  }
  data_ = whitening_.Applied(data);
}

void LoadEstimator::Fit(Linearization& skin, const MarkerObservations& observed,
                        const Eigen::VectorXd* untouched_norms, const FitOptions& options,
                        LoadEstimate& estimate) {
  SetData(skin, observed);
  Hide(observed);
  trials_ = 0;
  for (int round = 0;; ++round) {
    estimate = {};
    estimate.converged = FitColumnsAtHand(skin, untouched_norms, options) && trials_ < kMostTrials;
    estimate.trials = trials_;
    if (!estimate.converged) {
      fit_.hills.clear();
      return;
    }
    Finish(skin, estimate);
    if (columns_.HasAll() || !LetIn(skin, round >= kMostRounds)) return;
  }
}

// False: a solver did not come to its end.
bool LoadEstimator::FitColumnsAtHand(Linearization& skin, const Eigen::VectorXd* untouched_norms,
                                     const FitOptions& options) {
  fit_.hills.clear();
  fit_.slipping.clear();
  fit_.tangential.resize(data_.size(), 0);
  // With tangential forces in, the selection is made once more with these taken as unknown.
  for (int stage = 0; stage < 2; ++stage) {
    ProjectOut(fit_.tangential);
    const Eigen::VectorXd loads_before = loads_;
    std::vector<Hill> found = Select(skin, untouched_norms);
    if (!is_selected_ || found.size() > kMostHills) return false;
    Eliminate(found);
    if (options.may_be_ring) JoinHugs(skin, found);
    if (found.empty() && stage > 0) {
      // Bodies that hardly press, but drag: what is left beside their pull does not tell where they are.
      loads_ = loads_before;
      break;
    }
    fit_.hills = std::move(found);
    if (fit_.hills.empty()) {
      solution_ = {.loads = {}, .tangential = {}, .residual = data_, .chi2 = 0, .converged = true};
      if (hidden_.cols() > 0) solution_.residual -= hidden_ * (hidden_.transpose() * data_);
      solution_.chi2 = solution_.residual.squaredNorm();
      break;
    }
    FitWithoutTangential();
    if (options.has_tangential) LetSlip(skin);
    if (fit_.slipping.empty()) break;
  }
  return solution_.converged;
}

}  // namespace taclink
