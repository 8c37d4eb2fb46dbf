#include "sensing/force/compliance_estimator.h"

#include <cmath>
#include <utility>

namespace taclink {
namespace {

constexpr int kDefaultRefinement = 2;

int RefinementOf(const ForceOptions& options) {
  return options.refinement > 0 ? options.refinement : kDefaultRefinement;
}

}  // namespace

ComplianceEstimator::ComplianceEstimator(const LinkModel& model, ForceModel force_model,
                                         const ForceOptions& options,
                                         std::shared_ptr<PressurisedTangents> tangents)
    : force_model_(force_model),
      model_error_(0.05),
      pressure_error_(force_model == ForceModel::kLinear ? 0.03 : 0.01),
      sites_(MakeLoadSites(model, MakeShellMesh(model, RefinementOf(options)))),
      data_(model.markers.count(), options.noise_floor_mm),
      fit_(sites_, model.markers.count(), FitOptions(options, sites_.count())),
      predicted_mm_(3 * model.markers.count()),
      model_sigma_mm_(model.markers.count()),
      column_(3 * model.markers.count()) {
  fit_options_ = FitOptions(options, sites_.count());
  if (force_model == ForceModel::kLinear) {
    linear_ = LinearTangent(model, RefinementOf(options), sites_);
  } else {
    pressurised_ = tangents ? std::move(tangents)
                            : std::make_shared<PressurisedTangents>(model, RefinementOf(options), sites_);
    pressurised_->At(0);
  }
  last_.reserve(static_cast<size_t>(fit_options_.max_loads));
}

const SkinTangent* ComplianceEstimator::TangentAt(double pressure_mpa) {
  return pressurised_ ? pressurised_->At(pressure_mpa) : &linear_;
}

void ComplianceEstimator::SetData(const SkinShape& shape, double pressure_mpa, const SkinTangent& tangent) {
  predicted_mm_ = tangent.offset_mm + (pressure_mpa - tangent.pressure_mpa) * tangent.per_pressure;
  for (Eigen::Index m = 0; m < model_sigma_mm_.size(); ++m) {
    const Vec3 by_pressure = predicted_mm_.segment<3>(3 * m);
    const Vec3 by_loads = shape.measured[static_cast<size_t>(m)].displacement_mm - by_pressure;
    model_sigma_mm_[m] = model_error_ * by_loads.norm() + pressure_error_ * by_pressure.norm();
  }
  data_.Set(shape, predicted_mm_, model_sigma_mm_);
}

void ComplianceEstimator::FindLoads(const SkinTangent& tangent, NodalForces& forces) {
  fit_.Begin(data_);
  for (const auto& [site, load_n] : last_) {
    column_ = tangent.inward_mm_n.col(site).cast<double>();
    fit_.Add(data_, site, column_, load_n);
  }
  fit_.Optimise(fit_options_.significance);
  // Each pass lets one load in; more passes than this mean that rounding makes it turn in circles.
  for (int pass = 0;; ++pass) {
    const int site = fit_.MostSignificant(data_, tangent);
    if (site < 0) return;
    if (fit_.IsFull() || pass == 3 * fit_options_.max_loads) break;
    column_ = tangent.inward_mm_n.col(site).cast<double>();
    fit_.Add(data_, site, column_, 0);
    fit_.Optimise(fit_options_.significance);
  }
  forces.converged = false;
}

void ComplianceEstimator::Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) {
  ClearForces(static_cast<int>(model_sigma_mm_.size()), force_model_, forces);
  const SkinTangent* tangent = TangentAt(pressure_mpa);
  if (tangent == nullptr) {
    forces.converged = false;
    return;
  }
  SetData(shape, pressure_mpa, *tangent);
  FindLoads(*tangent, forces);
  last_.clear();
  for (size_t k = 0; k < fit_.sites_in().size(); ++k) {
    if (std::isfinite(fit_.load_n(k))) last_.push_back({fit_.sites_in()[k], fit_.load_n(k)});
  }
  fit_.RemoveBias();
  fit_.AddTangential(data_, [&](const auto& shares, int direction) -> const Eigen::VectorXd& {
    const auto& columns = direction == 0 ? tangent->around_mm_n : tangent->along_mm_n;
    column_.setZero();
    for (Eigen::Index k = 0; k < shares.size(); ++k) {
      column_ += shares[k] * columns.col(fit_.sites_in()[static_cast<size_t>(k)]).template cast<double>();
    }
    return column_;
  });
  fit_.Write(data_, forces);
}

}  // namespace taclink
