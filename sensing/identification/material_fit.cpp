#include "sensing/identification/material_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "sensing/identification/material_evidence.h"

namespace taclink {
namespace {

constexpr double kLeastModulusMpa = 1e-4, kMostModulusMpa = 1e5;  // as in model files
// Residuals: so large a share of what was measured, and so many of the stated standard deviations.
constexpr double kMostMisfit = 0.35, kMostDeviations = 3;
constexpr double kMeshSigma = 1e-3;  // of ln E
constexpr double kMostSigma = 0.33;  // of ln E; else nothing is known
constexpr int kMostRounds = 6;       // of leaving out outliers
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Kind {
  EvidenceAt evidence;
  std::vector<bool> outliers;
  double log_modulus = 0, sigma = 0;  // of ln E, alone
  double variance = 1;                // of the whitened residuals, in the common fit
};

Error Refused(const std::string& what) {
  return {ErrorCode::kFailedPrecondition, what};
}

std::string Percent(double share) {
  return std::to_string(std::lround(100 * share)) + " %";
}

class Fitter {
 public:
  Fitter(const LinkModel& model, MaterialLaw law, std::span<const InflationRecord> inflations,
         std::span<const ProbeRecord> probes, const MaterialFitOptions& options)
      : model_(model),
        response_(model, law, options.refinement, options.progress),
        inflations_(inflations),
        probes_(probes),
        options_(options) {}

  Result<MaterialFit> Fit();

 private:
  Result<void> FitAlone(Kind& kind, double start);
  Result<double> MinimumOf(const std::function<double(const Observations&)>& cost, const EvidenceAt& evidence,
                           double start);
  Result<void> FitInflation();
  Result<void> FitProbe();
  Result<double> Together();
  KindFit Told(const Kind& kind, const EvidenceSums& alone, const EvidenceSums& common) const;
  Result<MaterialFit> Summary(double log_modulus);
  void AddInflations(const Observations& seen, double modulus, MaterialFit& fit);
  void AddProbes(const Observations& seen, MaterialFit& fit) const;

  const LinkModel& model_;
  SkinResponse response_;
  std::span<const InflationRecord> inflations_;
  std::span<const ProbeRecord> probes_;
  MaterialFitOptions options_;
  std::unique_ptr<Kind> inflation_, probe_;  // none: no such records
  double tension_ = 0;
};

Result<double> Fitter::MinimumOf(const std::function<double(const Observations&)>& cost,
                                 const EvidenceAt& evidence, double start) {
  Error undefined;  // the last reason why the cost has no value
  const auto at = [&](double log_modulus) {
    const double modulus = std::exp(log_modulus);
    if (modulus < 0.9 * kLeastModulusMpa || modulus > 1.1 * kMostModulusMpa) {
      undefined = Refused("Young's modulus would be outside 1e-4 to 1e5 MPa; check units and pressures");
      return kInfinity;
    }
    const auto seen = evidence(modulus);
    if (!seen) undefined = seen.error();
    return seen ? cost(*seen) : kInfinity;
  };
  const Minimum minimum = Minimise(at, start);
  if (std::isinf(minimum.value)) return undefined;
  if (minimum.at_edge) {
    return Refused("the records want a softer skin than this law has an equilibrium for; " +
                   undefined.message);
  }
  return minimum.at;
}

// Least absolute residuals first, which outliers can't move far; then least squares of those that remain.
Result<void> Fitter::FitAlone(Kind& kind, double start) {
  const auto robust = [](const Observations& seen) {
    double sum = 0;
    for (const Observation& o : seen) sum += std::sqrt(1 + o.residual().squaredNorm());
    return sum;
  };
  auto at = MinimumOf(robust, kind.evidence, start);
  if (!at) return at.error();
  for (int round = 0; round < kMostRounds; ++round) {
    auto outliers = OutliersOf(*kind.evidence(std::exp(*at)));
    if (outliers == kind.outliers) break;
    kind.outliers = std::move(outliers);
    at = MinimumOf([&](const Observations& seen) { return Sum(seen, kind.outliers).chi2; }, kind.evidence,
                   *at);
    if (!at) return at.error();
  }
  kind.log_modulus = *at;
  return {};
}

// `sums` at the minimum.
Result<void> CheckFit(const std::string& what, const EvidenceSums& sums, double sigma) {
  const double misfit = std::sqrt(sums.chi2 / sums.measured2);
  if (misfit > kMostMisfit && sums.chi2 > kMostDeviations * kMostDeviations * sums.values) {
    return Refused(what + ": the residuals are " + Percent(misfit) +
                   " of what was measured: the model's geometry or law, units, or pressures are wrong, or "
                   "something touched the skin");
  }
  if (!(sigma < kMostSigma)) {
    return Refused(what + ": tell nothing of Young's modulus (standard deviation " + Percent(sigma) +
                   "); more records, or higher pressures, are needed");
  }
  return {};
}

Result<void> Fitter::FitInflation() {
  const auto start = LinearModulus(model_, response_, inflations_);
  if (!start) return start.error();
  if (!(*start > 0)) {
    return Refused(
        "inflation: the markers don't move outwards under pressure; check the rest shape and signs");
  }
  inflation_ = std::make_unique<Kind>();
  inflation_->evidence = InflationEvidence(model_, response_, inflations_);
  if (auto fitted = FitAlone(*inflation_, std::log(*start)); !fitted) return fitted;
  const double modulus = std::exp(inflation_->log_modulus);
  const Observations seen = *inflation_->evidence(modulus);
  if (auto good = CheckUntouched(model_, response_, inflations_, seen, inflation_->outliers, modulus); !good)
    return good;
  const EvidenceSums sums = Sum(seen, inflation_->outliers);
  double contradiction = 0;  // of records, chi-squared
  double roots = 0;          // of the records' curvatures
  int records = 0;
  for (size_t r = 0; r < inflations_.size(); ++r) {
    const EvidenceSums one = Sum(seen, inflation_->outliers, static_cast<int>(r));
    if (one.curvature <= 0) continue;
    ++records;
    roots += std::sqrt(one.curvature);
    contradiction += one.gradient * one.gradient / (one.curvature * sums.variance());
  }
  double more = records > 1 ? std::max(1.0, contradiction / (records - 1)) : 1;
  // Half of a displacement's variance is that of the rest shape, which the records may share.
  more *= (1 + roots * roots / sums.curvature) / 2;
  inflation_->sigma = std::hypot(kMeshSigma, std::sqrt(more * sums.variance() / sums.curvature));
  return CheckFit("inflation", sums, inflation_->sigma);
}

Result<void> Fitter::FitProbe() {
  const auto start = LinearModulus(response_, probes_, options_);
  if (!start) return start.error();
  probe_ = std::make_unique<Kind>();
  probe_->evidence = ProbeEvidence(response_, probes_, options_);
  const double known = inflation_ ? std::exp(inflation_->log_modulus) : model_.material.youngs_modulus_mpa;
  if (auto fitted = FitAlone(*probe_, std::log(*start > 0 ? *start : known)); !fitted) return fitted;
  const EvidenceSums sums = Sum(*probe_->evidence(std::exp(probe_->log_modulus)), probe_->outliers);
  probe_->sigma = std::hypot(kMeshSigma, std::sqrt(sums.variance() / sums.curvature));
  return CheckFit("probe forces", sums, probe_->sigma);
}

Result<double> Fitter::Together() {
  if (!inflation_ || !probe_) return (inflation_ ? *inflation_ : *probe_).log_modulus;
  const double apart = inflation_->log_modulus - probe_->log_modulus;
  const double expected = inflation_->sigma * inflation_->sigma + probe_->sigma * probe_->sigma;
  tension_ = apart / std::sqrt(expected);
  const double between = std::max(0.0, (apart * apart - expected) / 2);
  double weighted = 0, weights = 0;
  for (Kind* kind : {inflation_.get(), probe_.get()}) {
    const double squared = kind->sigma * kind->sigma + between;
    const auto seen = kind->evidence(std::exp(kind->log_modulus));
    kind->variance = squared * Sum(*seen, kind->outliers).curvature;
    weighted += kind->log_modulus / squared;
    weights += 1 / squared;
  }
  const auto both = [this](double modulus) -> Result<Observations> {
    auto all = inflation_->evidence(modulus);
    if (!all) return all.error();
    const auto forces = probe_->evidence(modulus);
    if (!forces) return forces.error();
    all->insert(all->end(), forces->begin(), forces->end());
    return all;
  };
  const auto cost = [this](const Observations& seen) {
    const auto split = seen.begin() + static_cast<std::ptrdiff_t>(inflation_->outliers.size());
    return Sum({seen.begin(), split}, inflation_->outliers).chi2 / inflation_->variance +
           Sum({split, seen.end()}, probe_->outliers).chi2 / probe_->variance;
  };
  return MinimumOf(cost, both, weighted / weights);
}

KindFit Fitter::Told(const Kind& kind, const EvidenceSums& alone, const EvidenceSums& common) const {
  const double modulus = std::exp(kind.log_modulus);
  return {.youngs_modulus_mpa = modulus,
          .sigma_mpa = kind.sigma * modulus,
          .values = alone.values,
          .chi2 = alone.chi2,
          .misfit = std::sqrt(common.chi2 / common.measured2)};
}

void Fitter::AddInflations(const Observations& seen, double modulus, MaterialFit& fit) {
  const EvidenceSums all = Sum(seen, inflation_->outliers);
  for (size_t r = 0; r < inflations_.size(); ++r) {
    const InflationRecord& record = inflations_[r];
    const SkinResponse::Growth growth = *response_.GrowthAt(record.pressure_mpa / modulus);
    const EvidenceSums sums = Sum(seen, inflation_->outliers, static_cast<int>(r));
    InflationFit one{.name = record.name, .pressure_mpa = record.pressure_mpa};
    double measured2 = 0, residual2 = 0;
    int full = 0;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (seen[i].record != static_cast<int>(r)) continue;
      ++(inflation_->outliers[i] ? one.outliers : one.used);
      if (inflation_->outliers[i] || seen[i].dims < 3) continue;
      const double angle = model_.PathAngle(model_.PathOf(seen[i].marker));
      const Vec2& grown = growth.mm[static_cast<size_t>(model_.RingOf(seen[i].marker))];
      const Vec3& u = record.markers[static_cast<size_t>(seen[i].marker)].displacement_mm;
      ++full;
      measured2 += u.squaredNorm();
      residual2 +=
          (u - Vec3(grown.x() * std::cos(angle), grown.x() * std::sin(angle), grown.y())).squaredNorm();
    }
    one.measured_mm = std::sqrt(measured2 / std::max(full, 1));
    one.rmse_mm = std::sqrt(residual2 / std::max(full, 1));
    if (sums.curvature > 0) {
      one.youngs_modulus_mpa = modulus * std::exp(sums.gradient / sums.curvature);
      one.sigma_mpa = one.youngs_modulus_mpa * std::sqrt(all.variance() / sums.curvature);
    }
    fit.inflations.push_back(std::move(one));
  }
}

void Fitter::AddProbes(const Observations& seen, MaterialFit& fit) const {
  for (size_t i = 0; i < seen.size(); ++i) {
    const ProbeRecord& record = probes_[static_cast<size_t>(seen[i].record)];
    fit.probes.push_back({.name = record.name,
                          .used = !probe_->outliers[i],
                          .measured_n = record.force_n,
                          .model_n = record.force_n * seen[i].model.x() / seen[i].measured.x()});
  }
}

Result<MaterialFit> Fitter::Summary(double log_modulus) {
  MaterialFit fit;
  const double modulus = std::exp(log_modulus);
  if (!(modulus >= kLeastModulusMpa && modulus <= kMostModulusMpa)) {
    return Refused("Young's modulus would be outside 1e-4 to 1e5 MPa; check units and pressures");
  }
  fit.material = response_.material();
  fit.material.youngs_modulus_mpa = modulus;
  fit.tension = tension_;
  double information = 0, misfit2 = 0;
  for (Kind* kind : {inflation_.get(), probe_.get()}) {
    if (!kind) continue;
    const Observations common = *kind->evidence(modulus);
    const EvidenceSums sums = Sum(common, kind->outliers);
    const EvidenceSums alone = Sum(*kind->evidence(std::exp(kind->log_modulus)), kind->outliers);
    const bool is_inflation = kind == inflation_.get();
    const KindFit told = Told(*kind, alone, sums);
    misfit2 += told.misfit * told.misfit;
    (is_inflation ? fit.inflation : fit.probe) = told;
    information += inflation_ && probe_ ? sums.curvature / kind->variance : 1 / (kind->sigma * kind->sigma);
    if (is_inflation) {
      AddInflations(common, modulus, fit);
    } else {
      AddProbes(common, fit);
    }
  }
  fit.misfit = std::sqrt(misfit2 / (inflation_ && probe_ ? 2 : 1));
  fit.sigma_mpa = modulus / std::sqrt(information);
  return fit;
}

Result<MaterialFit> Fitter::Fit() {
  if (!inflations_.empty()) {
    if (auto fitted = FitInflation(); !fitted) return fitted.error();
  }
  if (!probes_.empty()) {
    if (auto fitted = FitProbe(); !fitted) return fitted.error();
  }
  const auto log_modulus = Together();
  return log_modulus ? Summary(*log_modulus) : log_modulus.error();
}

}  // namespace

Result<MaterialFit> FitMaterial(const LinkModel& model, MaterialLaw law,
                                std::span<const InflationRecord> inflations,
                                std::span<const ProbeRecord> probes, const MaterialFitOptions& options) {
  if (auto good = CheckRecords(model, inflations, probes, options); !good) return good.error();
  return Fitter(model, law, inflations, probes, options).Fit();
}

}  // namespace taclink
