// What a fit of loads says: forces, centers, their covariances, and what is left unexplained.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "sensing/estimation/load_estimator.h"

namespace taclink {
namespace {

constexpr double kStillTangential =
    0.15;  // of a normal force: what a contact without a tangential one may have
constexpr double kHardlyN = 1e-6;
constexpr double kForceShare = 0.04;        // of a force: what the model gets wrong of it
constexpr double kCenterShare = 0.25;       // of a site's spacing: what the grid of loads makes of a center
constexpr double kUnmeasuredModulus = 0.1;  // castings of one silicone differ by as much

// Standard deviation of Young's modulus by itself.
double ModulusShare(const LinkModel& model) {
  if (!model.material_evidence) return kUnmeasuredModulus;
  return model.material_evidence->sigma_mpa / model.material.youngs_modulus_mpa;
}

}  // namespace

void LoadEstimator::Finish(Linearization& skin, LoadEstimate& estimate) {
  const std::vector<Hill>& hills = fit_.hills;
  const std::vector<int>& slipping = fit_.slipping;
  Eigen::Index at = 0;
  hill_of_load_.clear();
  for (size_t i = 0; i < hills.size(); ++i) {
    EstimatedLoad load;
    for (const int column : hills[i]) {
      const double inward = solution_.loads[at++];
      load.is_ring_contact = IsBand(column);
      ForSites(column, [&](int site, double share) {
        load.sites.push_back(site);
        load.inward_n.push_back(share * inward);
        load.shares.push_back(loads_[site]);
      });
      load.normal_force_n += inward;
    }
    const double sum = std::accumulate(load.shares.begin(), load.shares.end(), 0.0);
    for (double& share : load.shares) share /= sum;
    const auto slips = std::find(slipping.begin(), slipping.end(), static_cast<int>(i));
    load.has_tangential = slips != slipping.end();
    if (load.has_tangential) {
      const Eigen::Index first = kTangential * (slips - slipping.begin());
      load.tangential_n = solution_.tangential.segment<2>(first);
      load.couple_nmm = solution_.tangential.segment<2>(first + 2);
    }
    load.left_out_n = left_out_[i].force_n;
    if (load.normal_force_n <= 0) {
      if (!load.has_tangential) continue;
      // It drags and does not press, but where it is it is.
      load.normal_force_n = kHardlyN * mechanics_.force_unit();
      for (size_t k = 0; k < load.sites.size(); ++k) load.inward_n[k] = load.normal_force_n * load.shares[k];
    }
    WriteLoad(skin, load);
    estimate.loads.push_back(std::move(load));
    hill_of_load_.push_back(i);
  }
  WriteStray(skin, estimate);
}

void LoadEstimator::Conclude(Linearization& skin, LoadEstimate& estimate) {
  WriteMarkerCovariances();
  WriteCovariances(skin, estimate);
  MoveCenters(skin, estimate);
  Eigen::VectorXd& by_cameras_mm = estimate.by_cameras_mm;
  const Eigen::VectorXd modes = camera_modes_mm_.transpose() * pulls_per_mm_;
  by_cameras_mm = camera_modes_mm_ * modes;
  for (const CameraId id : kBothCameras) estimate.by_camera_mm[Index(id)] = camera_modes_.SeenBy(id) * modes;
  estimate.camera_shift_mm = by_cameras_mm.reshaped(3, by_cameras_mm.size() / 3).colwise().norm().maxCoeff();
  const Eigen::MatrixXd& by_baseline_mm = untouched_->by_baseline_mm;
  estimate.beside_mm =
      covariance_.Direct(pulls_per_mm_) + by_baseline_mm * (by_baseline_mm.transpose() * pulls_per_mm_);
  estimate.chi2_per_dof =
      solution_.residual.squaredNorm() /
      std::max<double>(1, static_cast<double>(std::count(is_shown_.begin(), is_shown_.end(), 1)));
  estimate.region_chi2_per_dof = WorstRegion(by_cameras_mm);
}

void LoadEstimator::WriteLoad(const Linearization& skin, EstimatedLoad& load) const {
  const int columns = mechanics_.columns();
  const auto top = std::max_element(load.inward_n.begin(), load.inward_n.end()) - load.inward_n.begin();
  const int origin = load.sites[static_cast<size_t>(top)] % columns;
  Vec2 center = Vec2::Zero(), tangential_center = Vec2::Zero();
  for (size_t k = 0; k < load.sites.size(); ++k) {
    const int site = load.sites[k];
    const int across = (site % columns - origin + columns + columns / 2) % columns - columns / 2;
    const Vec2 from_origin(across, site / columns);
    center += load.inward_n[k] * from_origin;
    tangential_center += load.shares[k] * from_origin;
    // A load spreads over neighbors whose normals differ.
    for (Eigen::SparseMatrix<double>::InnerIterator it(mechanics_.spread(), site); it; ++it) {
      const Mat3& frame = skin.frames()[static_cast<size_t>(it.row())];
      load.force_n += it.value() * (load.inward_n[k] * frame.col(0) +
                                    load.shares[k] * (frame.rightCols<2>() * load.tangential_n));
    }
  }
  load.center = Vec2(origin, 0) + center / load.normal_force_n;
  load.tangential_center = Vec2(origin, 0) + tangential_center;
}

void LoadEstimator::WriteStray(Linearization& skin, LoadEstimate& estimate) {
  pulls_per_mm_ = whitening_.Transposed(solution_.residual);
  const std::array<Eigen::VectorXd, 3> pulled = skin.PulledAtSites(pulls_per_mm_);
  inward_pulls_ = pulled[0];
  std::array<Eigen::VectorXd, 3> contacts;
  std::array<Eigen::VectorXd, 2> couples;
  for (auto& part : contacts) part.setZero(mechanics_.site_count());
  for (auto& part : couples) part.setZero(mechanics_.site_count());
  for (const EstimatedLoad& load : estimate.loads) {
    for (size_t k = 0; k < load.sites.size(); ++k) {
      contacts[0][load.sites[k]] += load.inward_n[k];
      contacts[1][load.sites[k]] += load.shares[k] * load.tangential_n.x();
      contacts[2][load.sites[k]] += load.shares[k] * load.tangential_n.y();
      for (size_t i = 0; i < 2; ++i)
        couples[i][load.sites[k]] += load.shares[k] * load.couple_nmm[static_cast<Eigen::Index>(i)];
    }
  }
  estimate.contact_sizes_n =
      (contacts[0].cwiseAbs2() + contacts[1].cwiseAbs2() + contacts[2].cwiseAbs2()).cwiseSqrt();
  Linearization::SiteLoads& all = estimate.at_sites;
  for (size_t i = 0; i < 2; ++i) all.couples_nmm[i] = mechanics_.spread() * couples[i];
  for (size_t k = 0; k < 3; ++k) {
    all.forces_n[k] = mechanics_.spread() * contacts[k];
    all.forces_n[k].array() += covariance_.stray_sigmas_n()[k].array().square() * pulled[k].array();
  }
  estimate.known_error = known_errors_ * (by_known_loads_.transpose() * pulls_per_mm_);
  // Displacements count from the baseline, so that what is missing in it shows with the other sign.
  estimate.baseline_error =
      -untouched_->baseline_errors * (untouched_->by_baseline_mm.transpose() * pulls_per_mm_);
}

// Of three columns a contact for its force, two for its place, and the known loads': the posterior of those
// beside what was fitted. The sites' own amplitudes are not free in it: their sum and place are.
void LoadEstimator::WriteCovariances(Linearization& skin, LoadEstimate& estimate) {
  const auto count = static_cast<Eigen::Index>(estimate.loads.size());
  const int columns = mechanics_.columns(), rows = mechanics_.site_rows();
  const auto site_at = [&](int row, int column) {
    return std::clamp(row, 0, rows - 1) * columns + (column + columns) % columns;
  };
  std::vector<int> asked;
  for (const EstimatedLoad& load : estimate.loads) {
    for (const int site : load.sites) {
      const int row = site / columns, column = site % columns;
      for (const int by : {-1, 1}) {
        asked.push_back(site_at(row + by, column));
        asked.push_back(site_at(row, column + by));
      }
      asked.push_back(site);
    }
  }
  MakeColumns(skin, std::move(asked));
  Eigen::MatrixXd design(data_.size(), 5 * count);
  Eigen::VectorXd prior = Eigen::VectorXd::Constant(5 * count, 1e-9);
  for (Eigen::Index i = 0; i < count; ++i) {
    const EstimatedLoad& load = estimate.loads[static_cast<size_t>(i)];
    auto normal = design.col(5 * i);
    auto around = design.col(5 * i + 3), along = design.col(5 * i + 4);
    normal.setZero();
    around.setZero();
    along.setZero();
    for (size_t k = 0; k < load.sites.size(); ++k) {
      const double share = load.inward_n[k] / load.normal_force_n;
      const int site = load.sites[k], row = site / columns, column = site % columns;
      const auto at = [&](int r, int c) { return columns_.Column(site_at(r, c)).cast<double>(); };
      normal += share * columns_.Column(site).cast<double>();
      around += 0.5 * load.inward_n[k] * (at(row, column + 1) - at(row, column - 1));
      along += 0.5 * load.inward_n[k] * (at(row + 1, column) - at(row - 1, column));
    }
    if (hidden_.cols() > 0) {
      for (const Eigen::Index column : {5 * i, 5 * i + 3, 5 * i + 4})
        design.col(column) -= hidden_ * (hidden_.transpose() * design.col(column));
    }
    design.middleCols<2>(5 * i + 1) =
        tangential_.columns[hill_of_load_[static_cast<size_t>(i)]].leftCols<2>();
    const double sigma =
        load.has_tangential ? kTangentialN * mechanics_.force_unit() : kStillTangential * load.normal_force_n;
    prior.segment<2>(5 * i + 1).setConstant(1 / (sigma * sigma));
    prior.segment<2>(5 * i + 3).setConstant(0.04);  // five sites
  }
  // The known loads' are the whitening's last columns; what is hidden does not tell of them.
  Eigen::MatrixXd left = whitening_.LastPosterior(known_errors_.cols());
  if (hidden_.cols() > 0) {
    const Eigen::MatrixXd untold = hidden_.transpose() * whitened_known_loads_;
    left += untold.transpose() * untold;
  }
  estimate.known_covariance = known_errors_ * left * known_errors_.transpose();
  if (count == 0) return;
  Eigen::MatrixXd information = design.transpose() * design;
  information.diagonal() += prior;
  const Eigen::MatrixXd covariance = information.llt().solve(Eigen::MatrixXd::Identity(5 * count, 5 * count));
  for (Eigen::Index i = 0; i < count; ++i) {
    EstimatedLoad& load = estimate.loads[static_cast<size_t>(i)];
    const int site = load.sites[static_cast<size_t>(
        std::max_element(load.inward_n.begin(), load.inward_n.end()) - load.inward_n.begin())];
    const Mat3& frame = skin.frames()[static_cast<size_t>(site)];
    if (load.is_ring_contact) {
      // How much it presses, and pulls along; sideways it may be uneven by as much.
      load.force_covariance_n2 =
          Vec3(covariance(5 * i, 5 * i), covariance(5 * i, 5 * i), covariance(5 * i + 2, 5 * i + 2))
              .asDiagonal();
    } else {
      load.force_covariance_n2 = frame * covariance.block<3, 3>(5 * i, 5 * i) * frame.transpose();
      // Left out because it explains little, not because it is known to be none.
      const Vec3 left_out = frame.rightCols<2>() * load.left_out_n;
      load.force_covariance_n2 += left_out * left_out.transpose();
    }
    const double size_n = std::max(load.force_n.norm(), load.normal_force_n);
    load.force_covariance_n2 += kForceShare * kForceShare / 3 * size_n * size_n * Mat3::Identity();
    // A force is as wrong as Young's modulus, less what pressure makes stiff.
    const double modulus_share = ModulusShare(mechanics_.model());
    if (load.is_ring_contact)
      load.force_covariance_n2 += std::pow(modulus_share * size_n, 2) / 2 * Vec3(1, 1, 0).asDiagonal();
    else
      load.force_covariance_n2 += std::pow(modulus_share, 2) * load.force_n * load.force_n.transpose();
    load.center_covariance = covariance.block<2, 2>(5 * i + 3, 5 * i + 3);
    load.center_covariance.diagonal().array() += kCenterShare * kCenterShare;
  }
}

// Factorizes the block of the covariance that belongs to these markers. The modes of camera motion are left
// out: they are shared by all markers and must not be fitted to one region.
Eigen::LLT<Eigen::MatrixXf> LoadEstimator::FactorOf(const std::vector<int>& markers) const {
  const Eigen::MatrixXf& all = whitening_.columns();
  const Eigen::Index known = known_errors_.cols(), others = all.cols() - known - camera_modes_mm_.cols();
  const auto count = static_cast<Eigen::Index>(markers.size());
  Eigen::MatrixXf more(3 * count, all.cols());
  for (Eigen::Index i = 0; i < count; ++i)
    more.middleRows<3>(3 * i) = all.middleRows<3>(3 * markers[static_cast<size_t>(i)]);
  Eigen::MatrixXf covariance_mm2 = more.leftCols(others) * more.leftCols(others).transpose();
  covariance_mm2 += more.rightCols(known) * more.rightCols(known).transpose();
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j)
      covariance_mm2.block<3, 3>(3 * i, 3 * j) +=
          untouched_->factored->Block(markers[static_cast<size_t>(i)], markers[static_cast<size_t>(j)]);
  }
  return Eigen::LLT<Eigen::MatrixXf>(covariance_mm2);
}

// Squared Mahalanobis distance by the cameras' noise alone, which is not below that by the whole covariance.
double LoadEstimator::NoiseDistance(const std::vector<int>& markers, const Eigen::VectorXf& left_mm) const {
  double sum = 0;
  for (const int marker : markers) {
    const Vec3 left = left_mm.segment<3>(3 * marker).cast<double>();
    sum += left.dot(noise_mm2_[static_cast<size_t>(marker)].llt().solve(left));
  }
  return sum;
}

// Mahalanobis' distance of the residual over 3 x 3 markers, per number, the largest; of regions that are
// mostly seen. A shape that is wrong is so at several markers: the one that contributes most counts as no
// more than twice the second, for it may be measured wrong alone.
double LoadEstimator::WorstRegion(const Eigen::VectorXd& by_cameras_mm) {
  const Eigen::VectorXf left_mm = (whitening_.Covariance(pulls_per_mm_) - by_cameras_mm).cast<float>();
  struct Bound {
    double most = 0;
    size_t region = 0;
    int shown = 0;
  };
  std::vector<Bound> bounds;
  for (size_t i = 0; i < regions_.size(); ++i) {
    int shown = 0;
    for (const int marker : regions_[i]) {
      for (int c = 0; c < 3; ++c) shown += is_shown_[static_cast<size_t>(3 * marker + c)];
    }
    if (shown >= static_cast<int>(regions_[i].size()))
      bounds.push_back({NoiseDistance(regions_[i], left_mm) / shown, i, shown});
  }
  std::ranges::sort(bounds, std::greater(), &Bound::most);
  double worst = 0;
  for (const auto& [bound, region, shown] : bounds) {
    if (bound <= worst) break;
    const std::vector<int>& markers = regions_[region];
    auto& factor = region_factors_[region];
    if (!factor) factor = FactorOf(markers);
    Eigen::VectorXf part(3 * static_cast<Eigen::Index>(markers.size()));
    for (size_t i = 0; i < markers.size(); ++i)
      part.segment<3>(3 * static_cast<Eigen::Index>(i)) = left_mm.segment<3>(3 * markers[i]);
    factor->matrixL().solveInPlace(part);
    double most = 0, second = 0;
    for (Eigen::Index row = 0; row < part.size(); row += 3) {
      const double square = part.segment<3>(row).squaredNorm();
      second = std::max(second, std::min(square, most));
      most = std::max(most, square);
    }
    worst = std::max(worst,
                     (static_cast<double>(part.squaredNorm()) - most + std::min(most, 2 * second)) / shown);
  }
  return worst;
}

}  // namespace taclink
