#include "sensing/pipeline/state_estimator.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sensing/contact/contact_writer.h"
#include "sensing/core/median.h"
#include "sensing/core/similar_skin.h"
#include "sensing/estimation/touch_responses.h"
#include "sensing/pipeline/encirclement.h"

namespace taclink {
namespace {

// Standard deviation of an unobserved marker, and of one that springs pull towards those observed; times
// LengthUnit of the skin.
constexpr double kUnknownMm = 5, kSpringsMm = 1;
constexpr double kWeakInformation = 1e-9;
// Of a pressure that the shape tells: what the model's inflation is wrong by, and the rest.
constexpr double kMovingGravitySigma = 1;  // m/s^2: of a link that may accelerate, standard gravity's
constexpr double kFromShapeShare = 0.05, kFromShapeMpa = 1e-4;

MeasuredLoads FromShape(double pressure_mpa, MeasuredLoads loads) {
  loads.pressure_mpa = pressure_mpa;
  loads.pressure_sigma_mpa = kFromShapeMpa + kFromShapeShare * std::abs(pressure_mpa);
  return loads;
}

SkinEstimatorOptions SkinOptions(const ForceOptions& options) {
  // The thesis' forces need the displacements of all markers, too.
  SkinEstimatorOptions skin;
  if (options.model != ForceModel::kLiteral) skin.model = options.model;
  skin.refinement = options.refinement;
  skin.most_work = options.most_work;
  return skin;
}

}  // namespace

StateEstimator::StateEstimator(const LinkModel& model, const ForceOptions& options)
    : model_(model),
      rest_mm_(model.RestMarkers()),
      options_(options),
      skin_(model, SkinOptions(options)),
      creep_(model) {
  if (options.model == ForceModel::kLiteral)
    thesis_ = std::make_unique<ThesisForce>(model, std::max(1, options.refinement));
  const SkinMechanics& mechanics = skin_.mechanics();
  for (int site = 0; site < mechanics.site_count(); ++site) {
    const auto distance2 = [&](const Vec3& marker) {
      return (marker - mechanics.RestSite(site)).squaredNorm();
    };
    const auto nearest =
        std::min_element(rest_mm_.begin(), rest_mm_.end(),
                         [&](const Vec3& a, const Vec3& b) { return distance2(a) < distance2(b); });
    marker_of_site_.push_back(static_cast<size_t>(nearest - rest_mm_.begin()));
  }
}

std::optional<Eigen::VectorXd> StateEstimator::UntouchedAt(const KnownLoads& loads) {
  const UntouchedSkin* skin = skin_.mechanics().Untouched(loads);
  if (skin == nullptr) return std::nullopt;
  return skin->markers_mm;
}

std::optional<RestShape> StateEstimator::RestShapeUnder(const MeasuredLoads& loads) {
  const UntouchedSkin* skin = skin_.mechanics().Untouched(loads.Loads());
  if (skin == nullptr) return std::nullopt;
  Eigen::MatrixXd errors_mm;
  if (!loads.specific_force_covariance.isZero(0))
    errors_mm = skin->markers_by_loads.rightCols<3>() * SpecificForceErrors(loads);
  return RestShape(model_, skin->markers_mm, std::move(errors_mm));
}

Eigen::VectorXd StateEstimator::ResidualMm(const KnownLoads& loads) {
  const Eigen::VectorXd inward_n = creep_.ResidualInward();
  if (inward_n.size() == 0) return {};
  const auto responses = TouchResponses(skin_.mechanics(), loads);
  if (!responses) return {};
  return (*responses * inward_n.cast<float>()).cast<double>();
}

RestSkin StateEstimator::AtRest() {
  return {
      .shape_at = [this](const MeasuredLoads& loads) { return RestShapeUnder(loads); },
      .touch_responses_at =
          [this](const MeasuredLoads& loads) { return TouchResponses(skin_.mechanics(), loads.Loads()); }};
}

MeasuredLoads StateEstimator::PressureFromShape(const MarkerObservations& observed, const LoadsPair& loads) {
  constexpr int kSteps = 6;
  const auto baseline = UntouchedAt(loads.baseline.Loads());
  double mpa = loads.now.pressure_mpa;
  if (!baseline) return FromShape(mpa, loads.now);
  std::vector<double> asked;
  for (int step = 0; step < kSteps; ++step) {
    const UntouchedSkin* skin = skin_.mechanics().Untouched({mpa, loads.now.specific_force_mps2});
    if (skin == nullptr) return FromShape(loads.now.pressure_mpa, loads.now);
    asked.clear();
    for (size_t m = 0; m < observed.information.size(); ++m) {
      const auto at = 3 * static_cast<Eigen::Index>(m);
      const Vec3 by = skin->markers_by_loads.col(0).segment<3>(at);
      const double information = by.dot(observed.information[m] * by);
      if (!(information > kWeakInformation)) continue;
      const Vec3 off =
          observed.displacement_mm[m] + baseline->segment<3>(at) - skin->markers_mm.segment<3>(at);
      asked.push_back(by.dot(observed.information[m] * off) / information);
    }
    if (asked.empty()) return FromShape(loads.now.pressure_mpa, loads.now);
    const double by = Median(asked);
    mpa = skin->loads.pressure_mpa + by;
    if (std::abs(by) < 1e-6) break;
  }
  return FromShape(mpa, loads.now);
}

void StateEstimator::WriteShape(SkinShape& shape) const {
  shape.positions_mm.resize(rest_mm_.size());
  shape.displacements_mm.resize(rest_mm_.size());
  shape.covariances_mm2.resize(rest_mm_.size());
  const bool is_answer = estimate_.failure == EstimateFailure::kNone;
  const bool has_baseline = estimate_.baseline_mm.size() > 0;
  for (size_t m = 0; m < rest_mm_.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    const MeasuredDisplacement& measured = shape.measured[m];
    const Vec3 baseline = has_baseline ? Vec3(estimate_.baseline_mm.segment<3>(at)) : Vec3::Zero();
    if (is_answer) {
      const Mat3 model = skin_.loads().ModelCovariance(static_cast<int>(m));
      shape.displacements_mm[m] = estimate_.displacements_mm.segment<3>(at) - baseline;
      // Of the model's error and the marker's own observation; both are of the same marker.
      shape.covariances_mm2[m] = (model.inverse() + measured.information_per_mm2).inverse() +
                                 skin_.loads().CameraCovariance(static_cast<int>(m));
      if (measured.information_per_mm2.isZero())
        shape.covariances_mm2[m].diagonal().array() += estimate_.unsettled_mm * estimate_.unsettled_mm;
    } else {
      const double unknown_mm = (estimate_.has_shape ? kSpringsMm : kUnknownMm) * LengthUnit(model_);
      const Mat3 information =
          measured.information_per_mm2 + 1 / (unknown_mm * unknown_mm) * Mat3::Identity();
      shape.covariances_mm2[m] = information.inverse();
      if (estimate_.has_shape)
        shape.displacements_mm[m] = estimate_.displacements_mm.segment<3>(at) - baseline;
      else
        shape.displacements_mm[m] =
            measured.information_per_mm2.isZero() ? Vec3::Zero() : measured.displacement_mm;
    }
    shape.positions_mm[m] = rest_mm_[m] + baseline + shape.displacements_mm[m];
  }
}

void StateEstimator::WriteForces(NodalForces& forces) {
  forces.model = estimate_.model;
  forces.converged = estimate_.failure == EstimateFailure::kNone;
  forces.residual = forces.region_residual = forces.camera_shift_mm = 0;
  forces.forces_n.assign(rest_mm_.size(), Vec3::Zero());
  forces.sigmas_n.assign(rest_mm_.size(), 0);
  forces.loaded.clear();
  forces.limits_n.clear();
  forces.limit_around_n = 0;
  if (!forces.converged) return;
  forces.residual = std::sqrt(estimate_.loads.chi2_per_dof);
  forces.region_residual = estimate_.loads.region_chi2_per_dof;
  forces.camera_shift_mm = estimate_.loads.camera_shift_mm;
  ContactWriter writer(skin_, estimate_);
  for (const EstimatedLoad& load : estimate_.loads.loads) writer.Lump(load, forces);
  for (size_t m = 0; m < rest_mm_.size(); ++m) {
    if (!forces.forces_n[m].isZero()) forces.loaded.push_back(static_cast<int>(m));
  }
  WriteLimits(forces);
}

// Of a marker, the worst of its site and those about it, up to the outer rings: what presses beyond is
// another matter (ReasonId::kBeyondMarkers).
void StateEstimator::WriteLimits(NodalForces& forces) {
  const SkinMechanics& mechanics = skin_.mechanics();
  const Eigen::VectorXd& limits_n = skin_.Limits().by_site_n;
  forces.limit_around_n = skin_.Limits().around_n;
  for (int marker = 0; marker < mechanics.marker_count(); ++marker)
    forces.limits_n.push_back(limits_n[mechanics.markers().node(marker) - mechanics.columns()]);
  for (size_t site = 0; site < marker_of_site_.size(); ++site) {
    if (mechanics.IsBeyondMarkers(static_cast<int>(site))) continue;
    double& limit_n = forces.limits_n[marker_of_site_[site]];
    limit_n = std::max(limit_n, limits_n[static_cast<Eigen::Index>(site)]);
  }
}

void StateEstimator::MakeLoadsReal() {
  if (!creep_.any() || estimate_.failure != EstimateFailure::kNone) return;
  ContactWriter writer(skin_, estimate_);
  CreepHistory::LumpedForces elastic_n;
  NodalForces lumped;
  for (const EstimatedLoad& load : estimate_.loads.loads) {
    lumped.forces_n.assign(rest_mm_.size(), Vec3::Zero());
    lumped.sigmas_n.assign(rest_mm_.size(), 0);
    writer.Lump(load, lumped);
    Eigen::VectorXd& forces_n = elastic_n.emplace_back(3 * static_cast<Eigen::Index>(rest_mm_.size()));
    for (size_t m = 0; m < rest_mm_.size(); ++m)
      forces_n.segment<3>(3 * static_cast<Eigen::Index>(m)) = lumped.forces_n[m];
  }
  creep_.MakeReal(elastic_n, estimate_.loads.loads);
}

void StateEstimator::Estimate(const LoadsPair& loads, SkinShape& shape, NodalForces& forces) {
  const size_t markers = rest_mm_.size();
  observation_.markers.displacement_mm.resize(markers);
  observation_.markers.information.resize(markers);
  for (size_t m = 0; m < markers; ++m) {
    const MeasuredDisplacement& measured = shape.measured[m];
    const bool good = measured.displacement_mm.allFinite() && measured.information_per_mm2.allFinite();
    observation_.markers.displacement_mm[m] = good ? measured.displacement_mm : Vec3::Zero();
    observation_.markers.information[m] = good ? measured.information_per_mm2 : Mat3::Zero();
  }
  observation_.loads = loads.now;
  observation_.baseline_loads = loads.baseline;
  skin_.Estimate(observation_, estimate_);
  MakeLoadsReal();
  WriteShape(shape);
  if (!thesis_) return WriteForces(forces);
  Eigen::VectorXd moved(3 * static_cast<Eigen::Index>(markers));
  for (size_t m = 0; m < markers; ++m)
    moved.segment<3>(3 * static_cast<Eigen::Index>(m)) = shape.displacements_mm[m];
  thesis_->Estimate(moved, loads.now.pressure_mpa - loads.baseline.pressure_mpa, forces);
  forces.camera_shift_mm = estimate_.loads.camera_shift_mm;
  forces.converged = estimate_.failure == EstimateFailure::kNone;  // or the shape is none
}

void StateEstimator::GiveUp(const LoadsPair& loads, SkinShape& shape, NodalForces& forces) {
  const ForceModel model = forces.model;
  skin_.Skip();
  estimate_.failure = EstimateFailure::kNotConverged;
  estimate_.has_shape = false;
  if (const auto baseline = UntouchedAt(loads.baseline.Loads())) estimate_.baseline_mm = *baseline;
  WriteShape(shape);
  WriteForces(forces);
  forces.model = model;
}

void StateEstimator::WriteKnownLoads(LinkState& state) const {
  state.pressure_estimate.reset();
  state.specific_force_estimate.reset();
  if (estimate_.failure != EstimateFailure::kNone) return;
  const KnownLoads loads =
      KnownLoads::FromStacked(estimate_.known_loads.Stacked() - observation_.loads.by_creep);
  const Mat4& covariance = estimate_.loads.known_covariance;
  state.pressure_estimate = {loads.pressure_mpa, std::sqrt(covariance(0, 0))};
  const Mat3 of_force = covariance.bottomRightCorner<3, 3>();
  if (of_force.isZero(0)) return;
  MeasuredLoads estimated{.specific_force_mps2 = loads.specific_force_mps2,
                          .specific_force_covariance = of_force};
  if (IsAttitudeUnknown(observation_.loads)) MeasureGravity(estimated, kMovingGravitySigma);
  state.specific_force_estimate = {estimated.specific_force_mps2, estimated.specific_force_covariance};
}

double StateEstimator::AttitudeErrorMm() {
  if (estimate_.failure != EstimateFailure::kNone || !IsAttitudeUnknown(observation_.loads)) return 0;
  const UntouchedSkin* skin = skin_.mechanics().Untouched(estimate_.known_loads);
  if (skin == nullptr) return 0;
  const Mat3 covariance = estimate_.loads.known_covariance.bottomRightCorner<3, 3>();
  double largest_mm2 = 0;
  for (Eigen::Index row = 0; row + 2 < skin->markers_by_loads.rows(); row += 3) {
    const Mat3 by = skin->markers_by_loads.block<3, 3>(row, 1);
    largest_mm2 = std::max(largest_mm2, (by * covariance * by.transpose()).trace());
  }
  return std::sqrt(largest_mm2);
}

void StateEstimator::FindContacts(ContactFinder& finder, const SkinShape& shape, const NodalForces& forces,
                                  std::vector<Contact>& contacts) {
  if (!forces.converged)
    contacts.clear();
  else if (thesis_)
    finder.FindIslands(shape.positions_mm, forces, contacts);
  else
    finder.Find(skin_, estimate_, contacts);
  AddEncirclementVariance(model_, forces.limit_around_n, contacts);
}

std::unique_ptr<StateEstimator> MakeStateEstimator(const LinkModel& model, const ForceOptions& options) {
  return std::make_unique<StateEstimator>(model, options);
}

}  // namespace taclink
