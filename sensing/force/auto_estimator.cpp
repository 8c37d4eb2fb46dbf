#include "sensing/force/auto_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/force/compliance_estimator.h"
#include "sensing/force/nonlinear_estimator.h"
#include "sensing/force/skin_tangent.h"

namespace taclink {
namespace {

constexpr double kStampRadiusMm = 2.75;
constexpr double kStartMm = 0.1;
// At which errors are learned, of PressureScale: up to 1.5 kPa for a skin of 0.1 MPa.
constexpr double kLearnedPressures[] = {0, 0.022, 0.082, 0.165};
constexpr double kHysteresis = 0.8;  // of the tolerance, to go back to a cheaper model

// The shape of a pushed skin as exact measurements.
SkinShape ShapeOf(const LinkModel& model, const PressedSkin& skin) {
  constexpr double kSigmaMm = 0.03;
  const Mat3 information = Mat3::Identity() / (kSigmaMm * kSigmaMm);
  SkinShape shape;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec3 u = skin.Marker(m) - model.RestMarker(m);
    shape.displacements_mm.push_back(u);
    shape.measured.push_back({u, information});
    shape.sources.push_back(MarkerSource::kBoth);
  }
  return shape;
}

double RelativeError(ForceEstimator& estimator, const SkinShape& shape, double pressure_mpa,
                     const Vec3& truth) {
  NodalForces forces;
  estimator.Restart();
  estimator.Estimate(shape, pressure_mpa, forces);
  Vec3 total = Vec3::Zero();
  for (const Vec3& f : forces.forces_n) total += f;
  estimator.Restart();
  return (total - truth).norm() / truth.norm();
}

}  // namespace

AutoEstimator::AutoEstimator(const LinkModel& model, const ForceOptions& options)
    : model_(model), options_(options) {
  if (options_.refinement == 0) options_.refinement = 1;  // else a new pressure takes several frames' time
  const LoadSites sites = MakeLoadSites(model, MakeShellMesh(model, options_.refinement));
  const auto tangents = std::make_shared<PressurisedTangents>(model, options_.refinement, sites);
  linear_ = std::make_unique<ComplianceEstimator>(model, ForceModel::kLinear, options_);
  pressurised_ = std::make_unique<ComplianceEstimator>(model, ForceModel::kPressurised, options_, tangents);
  nonlinear_ = std::make_unique<NonlinearEstimator>(model, options_, tangents);
  for (const double share : kLearnedPressures) {
    PressedSkin skin(model, {.refinement = 1});
    if (!skin.Inflate(share * PressureScale(model)).ok()) break;
    learned_.push_back(Learn(skin, share * PressureScale(model)));
  }
  inflation_per_mpa_ = tangents->At(0)->per_pressure;
}

// Pushes a marker in the middle with a stamp, deeper and deeper.
AutoEstimator::Learned AutoEstimator::Learn(PressedSkin& skin, double pressure_mpa) {
  Learned learned{pressure_mpa, {}, {}, {}};
  const int marker = model_.MarkerIndex(0, model_.markers.rings() / 2);
  const auto node = static_cast<size_t>(skin.mesh().NodeOfMarker(model_, marker));
  const Vec3 axis = skin.mesh().normals[node];
  const Vec3 start = skin.state().mids_mm[node] + (model_.thickness_mm / 2 + kStartMm) * axis;
  skin.AddBody(RigidStamp{start, -axis, kStampRadiusMm, 0.25}, true);
  const Vec3 inflated = skin.Marker(marker);
  double depth = -kStartMm;
  for (const double wanted : {1.0, 2.0, 4.0, 8.0}) {
    const Vec3 by = -(wanted - depth) * axis;
    if (!skin.Move({&by, 1}).ok()) break;
    depth = wanted;
    const SkinShape shape = ShapeOf(model_, skin);
    const Vec3 truth = skin.ContactOf(0).force_n;
    learned.depths_mm.push_back((skin.Marker(marker) - inflated).norm());
    learned.linear_errors.push_back(RelativeError(*linear_, shape, pressure_mpa, truth));
    learned.pressurised_errors.push_back(RelativeError(*pressurised_, shape, pressure_mpa, truth));
  }
  return learned;
}

AutoEstimator::~AutoEstimator() = default;

void AutoEstimator::Restart() {
  linear_->Restart();
  pressurised_->Restart();
  nonlinear_->Restart();
  last_ = ForceModel::kLinear;
}

// The worst of the learned ones up to the pressure and depth at hand; beyond them, not known.
double AutoEstimator::ErrorOf(ForceModel model, double pressure_mpa, double displacement_mm) const {
  if (model == ForceModel::kNonlinear) return 0;
  double worst = 0;
  for (const Learned& at : learned_) {
    const auto& errors = model == ForceModel::kLinear ? at.linear_errors : at.pressurised_errors;
    size_t d = 0;
    for (; d < errors.size(); ++d) {
      worst = std::max(worst, errors[d]);
      if (at.depths_mm[d] >= displacement_mm) break;
    }
    if (d == errors.size()) break;
    if (at.pressure_mpa >= std::abs(pressure_mpa)) return worst;
  }
  return std::numeric_limits<double>::infinity();
}

ForceModel AutoEstimator::Choose(const SkinShape& shape, double pressure_mpa) const {
  double largest = 0;
  for (size_t i = 0; i < shape.measured.size(); ++i) {
    if (shape.sources[i] == MarkerSource::kInferred) continue;
    const Vec3& u = shape.measured[i].displacement_mm;
    if (!u.allFinite()) continue;
    largest = std::max(
        largest, (u - pressure_mpa * inflation_per_mpa_.segment<3>(static_cast<Eigen::Index>(3 * i))).norm());
  }
  for (const ForceModel model : {ForceModel::kLinear, ForceModel::kPressurised}) {
    const double limit = model < last_ ? kHysteresis * options_.tolerance : options_.tolerance;
    if (ErrorOf(model, pressure_mpa, largest) <= limit) return model;
  }
  return ForceModel::kNonlinear;
}

void AutoEstimator::Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) {
  const ForceModel model = Choose(shape, pressure_mpa);
  last_ = model;
  ForceEstimator& estimator = model == ForceModel::kLinear        ? *linear_
                              : model == ForceModel::kPressurised ? *pressurised_
                                                                  : *nonlinear_;
  estimator.Estimate(shape, pressure_mpa, forces);
}

}  // namespace taclink
