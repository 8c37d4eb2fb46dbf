#include "bench/force/accuracy_report.h"

#include <algorithm>
#include <cstdio>
#include <set>

#include "bench/vision/error_plot.h"

namespace taclink {
namespace {

using Row = std::vector<std::string>;

std::string Number(double value, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string Share(int part, int whole) {
  return whole == 0 ? "-" : Number(100.0 * part / whole, 1) + " %";
}

double Mean(const std::vector<float>& values) {
  double sum = 0;
  for (const float v : values) sum += static_cast<double>(v);
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

std::string NoiseName(double noise_mm) {
  char text[32];
  std::snprintf(text, sizeof text, "%g mm", noise_mm);
  return noise_mm == 0 ? "exact markers" : std::string("noise of ") + text;
}

Row MethodCells(const AccuracyOutcome& outcome) {
  return {outcome.method.name(), outcome.model, outcome.method.mesh()};
}

std::string TimeCell(const std::vector<float>& samples) {
  return Number(Percentile(samples, 0.5), 3) + " / " + Number(Percentile(samples, 0.95), 3) + " / " +
         Number(Percentile(samples, 0.99), 3);
}

std::string Answers(const AccuracyOutcome& outcome) {
  std::string text;
  for (const auto& [name, count] : outcome.answered)
    text += (text.empty() ? "" : ", ") + name + " " + std::to_string(count);
  return text;
}

Row SummaryRow(const AccuracyOutcome& outcome) {
  const AccuracySummary s = Summarize(outcome);
  Row row = MethodCells(outcome);
  for (const std::string& cell :
       {Number(s.size_n, 3), Number(s.size_percent, 1), Number(s.size_percent_p95, 1),
        Number(s.vector_percent, 1), Number(s.direction_deg, 1),
        Number(s.center_mm, 1) + " / " + Number(s.center_mm_p95, 1), Number(s.phantom_n, 3),
        Share(s.phantom_frames, s.frames), Number(s.stray_n, 3), Share(s.missed, s.contacts),
        Share(s.force_told, s.contacts - s.missed) + ", " + Share(s.center_told, s.contacts - s.missed),
        Share(s.within, s.loaded_frames), Share(s.vector_within, s.loaded_frames), TimeCell(outcome.cpu_ms)})
    row.push_back(cell);
  return row;
}

ReportTable Main(const std::vector<const AccuracyOutcome*>& outcomes, double noise_mm) {
  ReportTable table{
      "All scenes, " + NoiseName(noise_mm),
      {"force model", "link", "refinement", "force, N", "%", "% p95", "vector, %", "direction, deg",
       "centre, mm p50 / p95", "worst phantom, N", "frames with phantoms", "stray, N", "missed",
       "force, centre within 2 sigma", "within", "with direction", "ms p50 / p95 / p99"},
      {}};
  for (const AccuracyOutcome* outcome : outcomes) {
    if (outcome->noise_mm == noise_mm) table.rows.push_back(SummaryRow(*outcome));
  }
  return table;
}

// One column for each group of scenes: mean error of the force and how many frames are within.
ReportTable Grouped(const std::string& title, const std::vector<const AccuracyOutcome*>& outcomes,
                    double noise_mm, const std::vector<std::pair<std::string, ChosenScene>>& groups) {
  ReportTable table{title + ", " + NoiseName(noise_mm) + ": mean error of the force in %, frames within",
                    {"force model", "link", "refinement"},
                    {}};
  for (const auto& [name, chosen] : groups) table.header.push_back(name);
  for (const AccuracyOutcome* outcome : outcomes) {
    if (outcome->noise_mm != noise_mm) continue;
    Row row = MethodCells(*outcome);
    for (const auto& [name, chosen] : groups) {
      const AccuracySummary s = Summarize(*outcome, chosen);
      row.push_back(s.contacts == 0 ? "-"
                                    : Number(s.size_percent, 0) + ", " + Share(s.within, s.loaded_frames));
    }
    table.rows.push_back(row);
  }
  return table;
}

std::vector<std::pair<std::string, ChosenScene>> ByKind() {
  std::vector<std::pair<std::string, ChosenScene>> groups;
  for (int k = 1; k < kPressKindCount; ++k) {
    const auto kind = static_cast<PressKind>(k);
    groups.emplace_back(Name(kind), [kind](const SceneScores& s) { return s.path->path.kind == kind; });
  }
  return groups;
}

std::vector<std::pair<std::string, ChosenScene>> ByPressure(
    const std::vector<const AccuracyOutcome*>& outcomes) {
  std::set<double> pressures;
  for (const AccuracyOutcome* outcome : outcomes) {
    for (const SceneScores& scene : outcome->scenes) pressures.insert(scene.path->path.pressure_mpa);
  }
  std::vector<std::pair<std::string, ChosenScene>> groups;
  for (const double pressure : pressures) {
    groups.emplace_back(Number(1e3 * pressure, 1) + " kPa",
                        [pressure](const SceneScores& s) { return s.path->path.pressure_mpa == pressure; });
  }
  return groups;
}

// None, where all skins are weightless.
std::vector<std::pair<std::string, ChosenScene>> ByAttitude(
    const std::vector<const AccuracyOutcome*>& outcomes) {
  std::set<std::string> attitudes;
  for (const AccuracyOutcome* outcome : outcomes) {
    for (const SceneScores& scene : outcome->scenes) attitudes.insert(scene.path->path.attitude);
  }
  std::vector<std::pair<std::string, ChosenScene>> groups;
  if (attitudes.size() < 2) return groups;
  for (const std::string& attitude : attitudes) {
    groups.emplace_back(attitude.empty() ? "weightless" : attitude,
                        [attitude](const SceneScores& s) { return s.path->path.attitude == attitude; });
  }
  return groups;
}

ReportTable Costs(const std::vector<const AccuracyOutcome*>& outcomes, double noise_mm) {
  ReportTable table{"Costs and answers, " + NoiseName(noise_mm),
                    {"force model", "link", "refinement", "at rest, ms p50", "p99 / p50", "construction, s",
                     "memory, MB", "not converged", "answered by (frames)"},
                    {}};
  for (const AccuracyOutcome* outcome : outcomes) {
    if (outcome->noise_mm != noise_mm) continue;
    const double median = Percentile(outcome->cpu_ms, 0.5);
    Row row = MethodCells(*outcome);
    for (const std::string& cell :
         {Number(Percentile(outcome->rest_cpu_ms, 0.5), 3),
          median > 0 ? Number(Percentile(outcome->cpu_ms, 0.99) / median, 1) : std::string("-"),
          Number(outcome->construction_s, 2), Number(outcome->memory_mb, 1),
          Share(outcome->not_converged, outcome->frames), Answers(*outcome)})
      row.push_back(cell);
    table.rows.push_back(row);
  }
  return table;
}

}  // namespace

AccuracySummary Summarize(const AccuracyOutcome& outcome, const ChosenScene& chosen) {
  AccuracySummary s;
  std::vector<float> size, percent, vector, vector_percent, direction, center, stray;
  const auto put = [](std::vector<float>& to, double value) { to.push_back(static_cast<float>(value)); };
  for (const SceneScores& scene : outcome.scenes) {
    if (!chosen(scene)) continue;
    for (const FrameScore& frame : scene.frames) {
      ++s.frames;
      s.phantom_n = std::max(s.phantom_n, frame.phantom_n);
      s.phantom_frames += frame.phantom_n > 0.03 ? 1 : 0;
      put(stray, frame.stray_n);
      if (frame.contacts.empty()) continue;
      ++s.loaded_frames;
      s.within += frame.Within() ? 1 : 0;
      s.vector_within += frame.VectorWithin() ? 1 : 0;
      for (const ContactScore& contact : frame.contacts) {
        ++s.contacts;
        s.missed += contact.missed ? 1 : 0;
        put(size, contact.size_error_n);
        put(percent, 100 * contact.size_error_n / contact.true_n);
        put(vector, contact.vector_error_n);
        put(vector_percent, 100 * contact.vector_error_n / contact.true_n);
        if (contact.missed) continue;
        put(direction, contact.direction_deg);
        put(center, contact.center_mm);
        s.force_told += contact.force_deviations <= 2 ? 1 : 0;
        s.center_told += contact.center_deviations <= 2 ? 1 : 0;
      }
    }
  }
  s.size_n = Mean(size);
  s.size_percent = Mean(percent);
  s.size_percent_p95 = Percentile(percent, 0.95);
  s.vector_n = Mean(vector);
  s.vector_percent = Mean(vector_percent);
  s.direction_deg = Percentile(direction, 0.5);
  s.center_mm = Percentile(center, 0.5);
  s.center_mm_p95 = Percentile(center, 0.95);
  s.stray_n = Mean(stray);
  return s;
}

AccuracySummary Summarize(const AccuracyOutcome& outcome) {
  return Summarize(outcome, [](const SceneScores&) { return true; });
}

std::vector<ReportTable> AccuracyTables(const std::vector<AccuracyOutcome>& outcomes,
                                        double detail_noise_mm) {
  std::vector<const AccuracyOutcome*> shown;
  std::set<double> noises;
  for (const AccuracyOutcome& outcome : outcomes) {
    noises.insert(outcome.noise_mm);
    shown.push_back(&outcome);
  }
  std::vector<ReportTable> tables;
  for (const double noise : noises) tables.push_back(Main(shown, noise));
  tables.push_back(Costs(shown, detail_noise_mm));
  tables.push_back(Grouped("By kind", shown, detail_noise_mm, ByKind()));
  tables.push_back(Grouped("By pressure", shown, detail_noise_mm, ByPressure(shown)));
  if (const auto by_attitude = ByAttitude(shown); !by_attitude.empty())
    tables.push_back(Grouped("By attitude", shown, detail_noise_mm, by_attitude));
  std::erase_if(tables, [](const ReportTable& table) { return table.rows.empty(); });
  return tables;
}

int ScenesOf(const PathTruth& truth) {
  if (!truth.path.bodies.empty()) return static_cast<int>(truth.stages.size());
  return truth.failure.empty() ? 1 : 0;
}

ReportTable FailedPaths(const std::vector<PathTruth>& truths) {
  ReportTable table{
      "Scenes left out: the forward solver did not get there", {"path", "scenes", "left out", "why"}, {}};
  for (const PathTruth& truth : truths) {
    if (truth.failure.empty()) continue;
    const int there = ScenesOf(truth);
    table.rows.push_back({truth.path.name, std::to_string(truth.path.scenes()),
                          std::to_string(truth.path.scenes() - there), truth.failure});
  }
  return table;
}

std::string AccuracyPlot(const std::vector<AccuracyOutcome>& outcomes, double noise_mm) {
  std::set<std::string> models;
  for (const AccuracyOutcome& outcome : outcomes) models.insert(outcome.model);
  std::vector<std::string> series;
  std::vector<PlotPoint> points;
  for (const AccuracyOutcome& outcome : outcomes) {
    if (outcome.noise_mm != noise_mm) continue;
    const std::string name = outcome.method.name();
    if (std::find(series.begin(), series.end(), name) == series.end()) series.push_back(name);
    const auto index = std::find(series.begin(), series.end(), name) - series.begin();
    const double time = Percentile(outcome.cpu_ms, 0.5), error = Summarize(outcome).size_percent;
    std::string label = name + " " + outcome.method.mesh();
    if (models.size() > 1) label += ", " + outcome.model;
    if (time > 0 && error > 0) points.push_back({time, error, static_cast<size_t>(index), label});
  }
  return LogPlot(points, "CPU time per frame, median, ms (the number beside a model: its refinement)",
                 "error of contact forces, mean, %, " + NoiseName(noise_mm));
}

}  // namespace taclink
