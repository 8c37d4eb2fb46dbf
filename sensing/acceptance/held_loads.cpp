#include "sensing/acceptance/held_loads.h"

#include <cmath>
#include <vector>

#include "sensing/acceptance/load_errors.h"
#include "sensing/acceptance/quantities.h"
#include "sensing/identification/relaxation_fit.h"

namespace taclink {
namespace {

constexpr size_t kEnds = 3;  // samples at either end of a hold

bool IsMeasuredHold(const AcceptanceTrial& trial) {
  return trial.kind == TrialKind::kHold && trial.state == TrialState::kMeasured && trial.loaded &&
         IsUsable(*trial.loaded) && trial.loaded->held.size() >= 3 * kEnds;
}

// Variance of one sample, N^2, from successive differences, which the slow change hardly affects.
double VarianceWithin(const std::vector<HeldSample>& held) {
  double sum2 = 0;
  for (size_t i = 1; i < held.size(); ++i) {
    const double step = held[i].force_n - held[i - 1].force_n;
    sum2 += step * step;
  }
  return sum2 / static_cast<double>(held.size() - 1) / 2;
}

}  // namespace

HeldLoads AnalyzeHolds(const AcceptanceRecord& record) {
  std::vector<GroupedValue> changes;
  double variances = 0, steps = 0;
  for (const AcceptanceTrial& trial : record.trials) {
    if (!IsMeasuredHold(trial)) continue;
    const auto& held = trial.loaded->held;
    double begin_n = 0, end_n = 0;
    for (size_t i = 0; i < kEnds; ++i) {
      begin_n += held[i].force_n / kEnds;
      end_n += held[held.size() - 1 - i].force_n / kEnds;
    }
    if (!(begin_n > 0)) continue;
    changes.push_back({static_cast<int>(trial.id), end_n / begin_n - 1});
    variances += VarianceWithin(held) * 2 / kEnds / (begin_n * begin_n);
    steps += static_cast<double>(held.size() - 1);
  }
  HeldLoads found{.change = GroupedMean(changes)};
  if (!changes.empty() && changes.size() < 3) {
    const auto holds = static_cast<double>(changes.size());
    found.change.half_width = StudentT95(steps) * std::sqrt(variances) / holds;
  }
  return found;
}

std::string FittedRelaxation(const AcceptanceRecord& record) {
  std::vector<RelaxationRecord> records;
  for (const AcceptanceTrial& trial : record.trials) {
    const auto reference_n = ReferenceForce(trial);
    if (!IsMeasuredHold(trial) || !reference_n || !(*reference_n > 0)) continue;
    RelaxationRecord& one = records.emplace_back();
    one.name = "trial " + std::to_string(trial.id);
    for (const HeldSample& sample : trial.loaded->held)
      one.samples.push_back({sample.time_s, sample.force_n, *reference_n});
  }
  if (records.empty()) return "";
  const auto fit = FitRelaxation(records);
  if (!fit) return "";
  std::string shares, times_s, sigmas;
  for (size_t i = 0; i < fit->terms.size(); ++i) {
    const char* const comma = i > 0 ? ", " : "";
    shares += comma + Format("%.3f", fit->terms[i].share);
    times_s += comma + Format("%.3g", fit->terms[i].time_s);
    sigmas += comma + Format("%.3f", fit->share_sigmas[i]);
  }
  return ", of the holds: relaxation: {shares: [" + shares + "], times_s: [" + times_s +
         "]}, standard deviations of the shares " + sigmas;
}

}  // namespace taclink
