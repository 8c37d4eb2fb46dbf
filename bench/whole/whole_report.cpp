#include "bench/whole/whole_report.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <numeric>

#include "bench/vision/error_plot.h"

namespace taclink {
namespace {

constexpr double kShapeMm = 1;

std::string Share(int part, int all) {
  if (all == 0) return "-";
  char text[24];
  std::snprintf(text, sizeof text, "%.1f %%", 100.0 * part / all);
  return text;
}
std::string Number(double value, int digits) {
  char text[24];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

struct OfMethod {
  ForceMethod method;
  std::string model;
  std::vector<const WholeOutcome*> outcomes;
};

// In the order in which they first come.
std::vector<OfMethod> ByMethod(const std::vector<WholeOutcome>& outcomes) {
  std::vector<OfMethod> groups;
  for (const WholeOutcome& outcome : outcomes) {
    const auto is_its = [&](const OfMethod& group) {
      return group.model == outcome.scene->model && group.method.model == outcome.method.model &&
             group.method.refinement == outcome.method.refinement;
    };
    auto at = std::find_if(groups.begin(), groups.end(), is_its);
    if (at == groups.end()) at = groups.insert(at, {outcome.method, outcome.scene->model, {}});
    at->outcomes.push_back(&outcome);
  }
  return groups;
}

double ErrorPercent(const WholeSummary& sum) {
  return sum.true_n > 0 ? 100 * sum.off_n / sum.true_n : 0;
}

bool IsNamed(const WholeFrame& frame, const WholeScene& scene) {
  return std::any_of(frame.reasons.begin(), frame.reasons.end(), [&](ReasonId id) {
    return std::find(scene.named_by.begin(), scene.named_by.end(), id) != scene.named_by.end();
  });
}

// The reasons that were given, most often first.
std::string ReasonsOf(const std::vector<const WholeOutcome*>& outcomes) {
  std::map<std::string, int> counts;
  for (const WholeOutcome* outcome : outcomes) {
    for (const WholeFrame& frame : outcome->frames) {
      for (const ReasonId id : frame.reasons) ++counts[Name(id)];
    }
  }
  std::vector<std::pair<int, std::string>> order;
  for (const auto& [name, count] : counts) order.emplace_back(-count, name);
  std::sort(order.begin(), order.end());
  std::string text;
  for (const auto& [count, name] : order)
    text += (text.empty() ? "" : ", ") + name + " " + std::to_string(-count);
  return text;
}

std::vector<std::string> Row(const std::string& name, const std::vector<const WholeOutcome*>& outcomes) {
  const WholeSummary sum = Summarize(outcomes);
  std::string reasons = ReasonsOf(outcomes);
  for (const WholeOutcome* outcome : outcomes) {
    if (!outcome->failure.empty()) reasons += (reasons.empty() ? "" : "; ") + outcome->failure;
    if (!outcome->frames.empty() && outcome->frames.back().status == LinkStatus::kCalibrating)
      reasons += (reasons.empty() ? "" : "; ") + ("no start: " + outcome->refusal);
  }
  return {name,
          std::to_string(sum.frames),
          Share(sum.ok, sum.frames),
          Share(sum.refused, sum.frames),
          Share(sum.right, sum.frames),
          std::to_string(sum.silent),
          Share(sum.within_2_sigma, sum.bodies),
          Share(sum.found_above_limit, sum.above_limit),
          Share(sum.shape_within, sum.ok),
          Number(sum.cpu_median_ms, 1),
          Number(sum.cpu_p99_ms, 1),
          Number(sum.cpu_worst_ms, 0),
          sum.to_be_named == 0          ? "-"
          : sum.named < sum.to_be_named ? "not always"
                                        : Number(sum.named_after_s, 2),
          reasons};
}

}  // namespace

WholeSummary Summarize(const std::vector<const WholeOutcome*>& outcomes) {
  WholeSummary sum;
  std::vector<double> cpu_ms;
  for (const WholeOutcome* outcome : outcomes) {
    std::optional<double> named_s;
    bool was_named = false;
    for (const WholeFrame& frame : outcome->frames) {
      if (frame.status == LinkStatus::kCalibrating) continue;
      ++sum.frames;
      cpu_ms.push_back(frame.cpu_ms);
      const bool is_ok = frame.status == LinkStatus::kOk;
      sum.ok += is_ok ? 1 : 0;
      sum.refused += frame.has_forces ? 0 : 1;
      if (frame.has_forces) {
        sum.true_n += frame.true_n;
        sum.off_n += frame.off_n;
      }
      sum.right += frame.has_forces && frame.is_right ? 1 : 0;
      sum.silent += frame.is_silent ? 1 : 0;
      if (is_ok) {
        sum.bodies += frame.bodies;
        sum.within_2_sigma += frame.within_2_sigma;
        sum.above_limit += frame.above_limit;
        sum.found_above_limit += frame.found_above_limit;
        sum.shape_within += frame.worst_marker_mm <= kShapeMm ? 1 : 0;
      }
      const double since_s = frame.time_s - std::max(0.0, outcome->scene->fault.begin_s);
      const bool is_named = IsNamed(frame, *outcome->scene);
      if (!named_s && since_s >= 0 && is_named && !was_named) named_s = since_s;
      was_named = is_named;
    }
    if (outcome->scene->named_by.empty()) continue;
    ++sum.to_be_named;
    if (!named_s) continue;
    ++sum.named;
    sum.named_after_s = std::max(sum.named_after_s, *named_s);
  }
  if (cpu_ms.empty()) return sum;
  std::sort(cpu_ms.begin(), cpu_ms.end());
  sum.cpu_mean_ms = std::accumulate(cpu_ms.begin(), cpu_ms.end(), 0.0) / static_cast<double>(cpu_ms.size());
  sum.cpu_median_ms = cpu_ms[cpu_ms.size() / 2];
  sum.cpu_p99_ms = cpu_ms[(cpu_ms.size() - 1) * 99 / 100];
  sum.cpu_worst_ms = cpu_ms.back();
  return sum;
}

std::vector<ReportTable> WholeTables(const std::vector<WholeOutcome>& outcomes) {
  std::vector<std::string> kinds;
  std::map<std::string, std::vector<const WholeOutcome*>> by_kind;
  for (const WholeOutcome& outcome : outcomes) {
    auto& of_kind = by_kind[outcome.scene->kind];
    if (of_kind.empty()) kinds.push_back(outcome.scene->kind);
    of_kind.push_back(&outcome);
  }
  std::vector<ReportTable> tables;
  for (const bool faults : {false, true}) {
    ReportTable table{
        faults ? "Faults" : "Nothing is wrong with the link",
        {"kind", "frames", "ok", "refused", "right", "silently wrong", "within 2 sigma", "found above limit",
         "markers within 1 mm", "CPU ms", "p99", "worst", "named after s", "reasons, frames"},
        {}};
    std::vector<const WholeOutcome*> all;
    for (const std::string& kind : kinds) {
      const auto& of_kind = by_kind[kind];
      if (IsFault(*of_kind.front()->scene) != faults) continue;
      table.rows.push_back(Row(kind, of_kind));
      all.insert(all.end(), of_kind.begin(), of_kind.end());
    }
    if (all.empty()) continue;
    table.rows.push_back(Row("all", all));
    table.rows.back().back().clear();
    tables.push_back(std::move(table));
  }
  return tables;
}

ReportTable WholeMethodTable(const std::vector<WholeOutcome>& outcomes) {
  ReportTable table{"Force models and meshes",
                    {"force model", "mesh", "link", "frames", "ok", "refused", "right", "silently wrong",
                     "error of the forces", "CPU ms, mean", "median", "p99", "worst"},
                    {}};
  for (const OfMethod& group : ByMethod(outcomes)) {
    const WholeSummary sum = Summarize(group.outcomes);
    table.rows.push_back({group.method.name(), group.method.mesh(), group.model, std::to_string(sum.frames),
                          Share(sum.ok, sum.frames), Share(sum.refused, sum.frames),
                          Share(sum.right, sum.frames), std::to_string(sum.silent),
                          sum.true_n > 0 ? Number(ErrorPercent(sum), 1) + " %" : "-",
                          Number(sum.cpu_mean_ms, 1), Number(sum.cpu_median_ms, 1), Number(sum.cpu_p99_ms, 1),
                          Number(sum.cpu_worst_ms, 0)});
  }
  return table;
}

std::string WholeMethodPlot(const std::vector<WholeOutcome>& outcomes) {
  std::vector<std::string> series;
  std::vector<PlotPoint> points;
  for (const OfMethod& group : ByMethod(outcomes)) {
    const std::string name = group.method.name();
    auto at = std::find(series.begin(), series.end(), name);
    if (at == series.end()) at = series.insert(at, name);
    const WholeSummary sum = Summarize(group.outcomes);
    if (sum.cpu_mean_ms <= 0 || ErrorPercent(sum) <= 0) continue;
    points.push_back({sum.cpu_mean_ms, ErrorPercent(sum), static_cast<size_t>(at - series.begin()),
                      name + " " + group.method.mesh() + ", " + group.model});
  }
  return LogPlot(points, "CPU time per frame, mean, ms (the number beside a model: its refinement)",
                 "error of the bodies' forces by what presses, %");
}

}  // namespace taclink
