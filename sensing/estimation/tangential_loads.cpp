// Forces along the wall, and where they act: the part of LoadEstimator that is about them.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "sensing/estimation/load_estimator.h"
#include "sensing/shell/dense.h"

namespace taclink {
namespace {

constexpr double kTangentialGain = 60;  // of chi^2
constexpr double kSurelyLittle = 0.5;   // of that, by columns of about the same shares
constexpr double kSameShares = 0.3;     // the sum of their changes
constexpr double kInformationRidge = 1e-9;
constexpr double kShiftSites = 2;  // standard deviation of where a tangential force acts about its hill

}  // namespace

bool LoadEstimator::TangentialColumns::AreAbout(const Eigen::MatrixXd& now) const {
  return shares.rows() == now.rows() && shares.cols() == now.cols() &&
         ((shares - now).cwiseAbs().colwise().sum().array() < kSameShares).all();
}

// By site, of each hill, how it shares its load: what its tangential force acts on.
Eigen::MatrixXd LoadEstimator::SharesOf(const std::vector<Hill>& hills) const {
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(mechanics_.site_count(), std::ssize(hills));
  for (Eigen::Index i = 0; i < shares.cols(); ++i) {
    for (const int column : hills[static_cast<size_t>(i)])
      ForSites(column, [&](int site, double) { shares(site, i) = loads_[site]; });
    shares.col(i) /= shares.col(i).sum();
  }
  return shares;
}

// By hill, of forces of 1 N around and along, and of couples.
void LoadEstimator::MakeTangentialColumns(const Linearization& skin, Eigen::MatrixXd shares) {
  LoadCases cases;
  for (const auto& of_hill : shares.colwise()) {
    const Eigen::VectorXd spread = mechanics_.spread() * of_hill;
    const auto add = [&](const auto& load_at) {
      cases.Begin();
      for (int site = 0; site < mechanics_.site_count(); ++site) {
        if (spread[site] != 0) cases.Add(site, spread[site] * load_at(site));
      }
    };
    for (const auto direction : {Linearization::kAround, Linearization::kAlong})
      add([&](int site) { return skin.ForceAt(direction, site); });
    for (const auto axis : {Linearization::kAround, Linearization::kAlong})
      add([&](int site) { return skin.CoupleAt(axis, site); });
  }
  Eigen::MatrixXf single = skin.Displacements(cases);
  whitening_.Apply(single);
  Eigen::MatrixXd columns = single.cast<double>();
  if (hidden_.cols() > 0) columns -= hidden_ * (hidden_.transpose() * columns);
  tangential_ = {.shares = std::move(shares), .columns = {}};
  for (Eigen::Index i = 0; i < columns.cols(); i += kTangential)
    tangential_.columns.emplace_back(columns.middleCols<kTangential>(i));
}

// Information that is there before the data, by column.
Eigen::VectorXd LoadEstimator::TangentialPrior(Eigen::Index columns) const {
  const double force = kTangentialN * mechanics_.force_unit(),
               couple = kCoupleNmm * mechanics_.force_unit() * mechanics_.length_unit();
  Eigen::VectorXd prior(columns);
  for (Eigen::Index k = 0; k < columns; ++k)
    prior[k] = k % kTangential < 2 ? 1 / (force * force) : 1 / (couple * couple);
  return prior;
}

// Whitened, of loads that act and tangential forces that were let in.
LoadEstimator::FitColumns LoadEstimator::ColumnsOf(const std::vector<int>& acting,
                                                   const Eigen::MatrixXd& tangential) const {
  const auto loads = static_cast<Eigen::Index>(acting.size());
  FitColumns fit;
  fit.columns.resize(data_.size(), loads + tangential.cols());
  fit.columns << columns_.columns()(Eigen::all, columns_.Places(acting)).cast<double>(), tangential;
  if (hidden_.cols() > 0) fit.columns -= hidden_ * (hidden_.transpose() * fit.columns);
  Eigen::MatrixXd information;
  dense::TransposedProduct(fit.columns, fit.columns, information);
  if (loads > 0)
    information.diagonal().head(loads).array() +=
        kInformationRidge * information.diagonal().head(loads).mean();
  information.diagonal().tail(tangential.cols()) += TangentialPrior(tangential.cols());
  fit.factor.compute(information);
  return fit;
}

// What the data say of more columns, if those of the fit are free.
Eigen::MatrixXd LoadEstimator::InformationBeside(const FitColumns& fit, const Eigen::MatrixXd& own) const {
  Eigen::MatrixXd cross;
  dense::TransposedProduct(fit.columns, own, cross);
  return own.transpose() * own - cross.transpose() * fit.factor.solve(cross);
}

// What each hill's tangential force would explain beside the loads that act and the tangential forces that
// were let in, if no load had to stay above zero.
std::vector<LoadEstimator::TangentialGain> LoadEstimator::TangentialGains(const std::vector<int>& sites,
                                                                          const Eigen::MatrixXd& tangential,
                                                                          const Solution& solution) const {
  std::vector<int> acting;
  for (size_t i = 0; i < sites.size(); ++i) {
    if (solution.loads[static_cast<Eigen::Index>(i)] > 0) acting.push_back(sites[i]);
  }
  const FitColumns fit = ColumnsOf(acting, tangential);
  std::vector<TangentialGain> gains;
  for (const Eigen::MatrixXd& own : tangential_.columns) {
    Eigen::MatrixXd left = InformationBeside(fit, own);
    left.diagonal() += TangentialPrior(own.cols());
    const Eigen::VectorXd pull = own.transpose() * solution.residual;
    const Eigen::VectorXd force = left.ldlt().solve(pull);
    gains.push_back({pull.dot(force), force.head<2>()});
  }
  return gains;
}

void LoadEstimator::FitWithoutTangential() {
  fit_.slipping.clear();
  fit_.tangential.resize(data_.size(), 0);
  left_out_.assign(fit_.hills.size(), {});
  solution_ = Refit(HillFinder::AllOf(fit_.hills), fit_.tangential);
}

// One after the other, the hill first whose tangential force explains most; none that explains little: what a
// shell gets wrong of a solid looks like a tangential force of the normal one's size. Columns of shares that
// were about the same do to tell that a force explains little, not to estimate one.
void LoadEstimator::LetSlip(const Linearization& skin) {
  const std::vector<Hill>& hills = fit_.hills;
  const std::vector<int> sites = HillFinder::AllOf(hills);
  Eigen::MatrixXd shares = SharesOf(hills);
  bool are_about = tangential_.AreAbout(shares);
  if (!are_about) MakeTangentialColumns(skin, shares);
  while (fit_.slipping.size() < hills.size()) {
    left_out_ = TangentialGains(sites, fit_.tangential, solution_);
    trials_ += static_cast<int>(hills.size());
    for (const int hill : fit_.slipping) left_out_[static_cast<size_t>(hill)] = {};
    const auto best = std::max_element(left_out_.begin(), left_out_.end(),
                                       [](const auto& a, const auto& b) { return a.chi2 < b.chi2; }) -
                      left_out_.begin();
    const double gain = left_out_[static_cast<size_t>(best)].chi2;
    if (std::exchange(are_about, false) && !(gain < kSurelyLittle * kTangentialGain)) {
      MakeTangentialColumns(skin, shares);
      continue;
    }
    if (!(gain > kTangentialGain)) return;
    Eigen::MatrixXd more(data_.size(), fit_.tangential.cols() + kTangential);
    more << fit_.tangential, tangential_.columns[static_cast<size_t>(best)];
    Solution with = Refit(sites, more);
    if (!(solution_.chi2 - with.chi2 > kTangentialGain)) return;
    fit_.slipping.push_back(static_cast<int>(best));
    left_out_[static_cast<size_t>(best)] = {};
    fit_.tangential = std::move(more);
    solution_ = std::move(with);
  }
}

// What a tangential force moves by, if it acts a site farther around, or along: columns are linear in the
// shares.
Eigen::MatrixXd LoadEstimator::ShiftColumns(const Linearization& skin, const EstimatedLoad& load) const {
  const int columns = mechanics_.columns(), rows = mechanics_.site_rows();
  LoadCases cases;
  for (int axis = 0; axis < 2; ++axis) {
    Eigen::VectorXd change = Eigen::VectorXd::Zero(mechanics_.site_count());
    for (size_t k = 0; k < load.sites.size(); ++k) {
      const int row = load.sites[k] / columns, column = load.sites[k] % columns;
      for (const int by : {-1, 1}) {
        const int r = axis == 1 ? std::clamp(row + by, 0, rows - 1) : row;
        const int c = axis == 0 ? (column + by + columns) % columns : column;
        change[r * columns + c] += 0.5 * by * load.shares[k];
      }
    }
    const Eigen::VectorXd spread = mechanics_.spread() * change;
    cases.Begin();
    for (int site = 0; site < mechanics_.site_count(); ++site) {
      if (spread[site] == 0) continue;
      cases.Add(site, spread[site] * (load.tangential_n.x() * skin.ForceAt(Linearization::kAround, site) +
                                      load.tangential_n.y() * skin.ForceAt(Linearization::kAlong, site)));
    }
  }
  Eigen::MatrixXd shift = whitening_.Applied(Eigen::MatrixXd(skin.Displacements(cases).cast<double>()));
  if (hidden_.cols() > 0) shift -= hidden_ * (hidden_.transpose() * shift);
  return shift;
}

// A body that drags the skin presses its front and lifts its rear: inward loads tell little of where it is,
// and the first guess of where the tangential force acts was made from them. To first order the data tell
// where it does; the center is that of all forces.
void LoadEstimator::MoveCenters(const Linearization& skin, LoadEstimate& estimate) const {
  std::vector<int> acting;
  Eigen::MatrixXd tangential(data_.size(), 0);
  for (size_t i = 0; i < estimate.loads.size(); ++i) {
    const EstimatedLoad& load = estimate.loads[i];
    for (size_t k = 0; k < load.sites.size(); ++k) {
      if (load.inward_n[k] > 0) acting.push_back(load.sites[k]);
    }
    if (!load.has_tangential) continue;
    tangential.conservativeResize(Eigen::NoChange, tangential.cols() + kTangential);
    tangential.rightCols(kTangential) = tangential_.columns[hill_of_load_[i]];
  }
  if (tangential.cols() == 0) return;
  const FitColumns fit = ColumnsOf(acting, tangential);
  for (EstimatedLoad& load : estimate.loads) {
    if (!load.has_tangential) continue;
    const Eigen::MatrixXd own = ShiftColumns(skin, load);
    Mat2 left = InformationBeside(fit, own);
    left.diagonal().array() += 1 / (kShiftSites * kShiftSites);
    const Mat2 covariance = left.inverse();
    const Vec2 shift = covariance * (own.transpose() * solution_.residual);
    const double tangential_n = load.tangential_n.norm(),
                 weight = tangential_n / (tangential_n + load.normal_force_n);
    load.center += weight * (load.tangential_center + shift - load.center);
    load.center_covariance += weight * weight * covariance;
  }
}

}  // namespace taclink
