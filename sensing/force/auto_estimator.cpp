#include "sensing/force/auto_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/force/compliance_estimator.h"
#include "sensing/force/nonlinear_estimator.h"
#include "sensing/force/skin_tangent.h"
#include "sensing/mechanics/pressed_skin.h"

namespace taclink {
namespace {

constexpr double kStampRadiusMm = 2.75;
constexpr double kStartMm = 0.1;
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

AutoEstimator::AutoEstimator(const LinkModel& model, const ForceOptions& options) : options_(options) {
  linear_ = std::make_unique<ComplianceEstimator>(model, ForceModel::kLinear, options);
  pressurised_ = std::make_unique<ComplianceEstimator>(model, ForceModel::kPressurised, options);
  nonlinear_ = std::make_unique<NonlinearEstimator>(model, options);
  const double scale = model.material.youngs_modulus_mpa / 0.1;
  const int marker = model.MarkerIndex(0, model.markers.rings() / 2);
  for (const double pressure_mpa : {0.0, 0.2e-3 * scale, 0.75e-3 * scale, 1.5e-3 * scale}) {
    PressedSkin skin(model, {.refinement = 1});
    if (!skin.Inflate(pressure_mpa).ok()) break;
    const auto node = static_cast<size_t>(skin.mesh().NodeOfMarker(model, marker));
    const Vec3 axis = skin.mesh().normals[node];
    const Vec3 start = skin.state().mids_mm[node] + (model.thickness_mm / 2 + kStartMm) * axis;
    skin.AddBody(RigidStamp{start, -axis, kStampRadiusMm, 0.25}, true);
    const Vec3 inflated = skin.Marker(marker);
    std::vector<double> linear, pressurised;
    depths_mm_.clear();
    double depth = -kStartMm;
    for (const double wanted : {1.0, 2.0, 4.0, 8.0}) {
      const Vec3 by = -(wanted - depth) * axis;
      if (!skin.Move({&by, 1}).ok()) break;
      depth = wanted;
      const SkinShape shape = ShapeOf(model, skin);
      const Vec3 truth = skin.ContactOf(0).force_n;
      depths_mm_.push_back((skin.Marker(marker) - inflated).norm());
      linear.push_back(RelativeError(*linear_, shape, pressure_mpa, truth));
      pressurised.push_back(RelativeError(*pressurised_, shape, pressure_mpa, truth));
    }
    pressures_mpa_.push_back(pressure_mpa);
    linear_errors_.push_back(std::move(linear));
    pressurised_errors_.push_back(std::move(pressurised));
  }
  const LoadSites sites = MakeLoadSites(model, MakeShellMesh(model, 1));
  inflation_per_mpa_ = LinearTangent(model, 1, sites).per_pressure;
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
  const auto& errors = model == ForceModel::kLinear ? linear_errors_ : pressurised_errors_;
  double worst = 0;
  for (size_t p = 0; p < pressures_mpa_.size(); ++p) {
    const bool last_needed = pressures_mpa_[p] >= std::abs(pressure_mpa);
    size_t d = 0;
    for (; d < errors[p].size(); ++d) {
      worst = std::max(worst, errors[p][d]);
      if (depths_mm_[d] >= displacement_mm) break;
    }
    if (d == errors[p].size()) return std::numeric_limits<double>::infinity();
    if (last_needed) return worst;
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
