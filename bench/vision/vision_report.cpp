#include "bench/vision/vision_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

namespace taclink {
namespace {

constexpr size_t kBoth = 2, kOne = 1, kNone = 0;
using Row = std::vector<std::string>;

std::string Number(double value, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string Share(int64_t part, int64_t whole, int digits = 2) {
  return whole == 0 ? "-"
                    : Number(100 * static_cast<double>(part) / static_cast<double>(whole), digits) + " %";
}

std::string Mm(const ErrorSums& sums, ErrorAxis axis) {
  return sums.count == 0 ? "-" : Number(sums.Rms(axis), 3);
}

std::string WorstMm(const ErrorSums& sums) {
  return sums.count == 0 ? "-" : Number(sums.Worst(ErrorAxis::k3d), 2);
}

LabelCounts BothCameras(const VisionScore& score) {
  LabelCounts sum = score.labels[0];
  sum.Add(score.labels[1]);
  return sum;
}

std::string Root(double squares, int64_t count) {
  return count == 0 ? "-" : Number(std::sqrt(std::max(0.0, squares) / static_cast<double>(count)), 3);
}

std::vector<std::string> ModelsOf(const std::vector<SceneOutcome>& outcomes) {
  std::vector<std::string> models;
  for (const SceneOutcome& outcome : outcomes) {
    if (std::find(models.begin(), models.end(), outcome.model) == models.end())
      models.push_back(outcome.model);
  }
  return models;
}

ReportTable AllScenes(const std::vector<SceneOutcome>& outcomes,
                      const std::vector<VisionMethodKind>& methods) {
  ReportTable table{"All scenes",
                    {"method", "model", "both: RMSE", "worst", "one: RMSE", "worst", "none: RMSE", "worst",
                     "displacement RMSE", "wrong labels", "stray", "missing", "measured", "ms p50", "p99"},
                    {}};
  for (size_t i = 0; i < methods.size(); ++i) {
    for (const std::string& model : ModelsOf(outcomes)) {
      const VisionScore s = SumScores(outcomes, i, [&](const SceneOutcome& o) { return o.model == model; });
      const LabelCounts labels = BothCameras(s);
      Row row = {methods[i].name, model};
      for (const size_t cameras : {kBoth, kOne, kNone}) {
        row.push_back(Mm(s.position[cameras], ErrorAxis::k3d));
        row.push_back(WorstMm(s.position[cameras]));
      }
      row.push_back(Mm(s.displacement[kBoth], ErrorAxis::k3d));
      row.push_back(std::to_string(labels.wrong));
      row.push_back(std::to_string(labels.stray));
      row.push_back(Share(labels.missing, labels.visible));
      row.push_back(Share(s.measured, s.frames, 1));
      row.push_back(Number(Percentile(s.times.vision, 0.5), 2));
      row.push_back(Number(Percentile(s.times.vision, 0.99), 2));
      table.rows.push_back(row);
    }
  }
  return table;
}

ReportTable ByCategory(const std::vector<SceneOutcome>& outcomes, size_t method, const std::string& name) {
  ReportTable table{"By category: " + name,
                    {"category", "scenes", "frames", "R", "phi R", "Z", "3-D", "worst", "systematic",
                     "random", "one: RMSE", "none: RMSE", "wrong", "stray", "missing", "measured"},
                    {}};
  for (int c = 0; c < kSceneCategoryCount; ++c) {
    const auto category = static_cast<SceneCategory>(c);
    const auto chosen = [&](const SceneOutcome& o) { return o.category == category; };
    const auto scenes = std::count_if(outcomes.begin(), outcomes.end(), chosen);
    if (scenes == 0) continue;
    const VisionScore s = SumScores(outcomes, method, chosen);
    const ErrorSums& both = s.position[kBoth];
    const LabelCounts labels = BothCameras(s);
    table.rows.push_back({Name(category), std::to_string(scenes), std::to_string(s.frames),
                          Mm(both, ErrorAxis::kR), Mm(both, ErrorAxis::kPhiR), Mm(both, ErrorAxis::kZ),
                          Mm(both, ErrorAxis::k3d), WorstMm(both), Root(s.systematic, s.split_count),
                          Root(s.random, s.split_count), Mm(s.position[kOne], ErrorAxis::k3d),
                          Mm(s.position[kNone], ErrorAxis::k3d), std::to_string(labels.wrong),
                          std::to_string(labels.stray), Share(labels.missing, labels.visible),
                          Share(s.measured, s.frames, 1)});
  }
  return table;
}

ReportTable Covariances(const std::vector<SceneOutcome>& outcomes,
                        const std::vector<VisionMethodKind>& methods) {
  ReportTable table{
      "Consistency of the covariances",
      {"method", "model", "source", "markers", "mean", "mean without the largest 1 %", "median"},
      {}};
  constexpr std::array<const char*, kSourceCount> kSources = {"both cameras", "top only", "bottom only",
                                                              "none"};
  for (size_t i = 0; i < methods.size(); ++i) {
    for (const std::string& model : ModelsOf(outcomes)) {
      const VisionScore s = SumScores(outcomes, i, [&](const SceneOutcome& o) { return o.model == model; });
      for (size_t source = 0; source < kSourceCount; ++source) {
        const Consistency c = ConsistencyOf(s.nees[source]);
        if (c.count == 0) continue;
        table.rows.push_back({methods[i].name, model, kSources[source], std::to_string(c.count),
                              Number(c.mean, 2), Number(c.trimmed, 2), Number(c.median, 2)});
      }
    }
  }
  return table;
}

ReportTable Times(const std::vector<SceneOutcome>& outcomes, const std::vector<VisionMethodKind>& methods) {
  ReportTable table{"CPU time per stereo pair, ms (p50 / p90 / p99)",
                    {"method", "model", "decode", "detect", "label", "shape", "detect + label + shape",
                     "with decoding and forces"},
                    {}};
  for (size_t i = 0; i < methods.size(); ++i) {
    for (const std::string& model : ModelsOf(outcomes)) {
      const StageSamples t =
          SumScores(outcomes, i, [&](const SceneOutcome& o) { return o.model == model; }).times;
      Row row = {methods[i].name, model};
      for (const auto* stage : {&t.decode, &t.detect, &t.label, &t.shape, &t.vision, &t.whole}) {
        row.push_back(Number(Percentile(*stage, 0.5), 2) + " / " + Number(Percentile(*stage, 0.9), 2) +
                      " / " + Number(Percentile(*stage, 0.99), 2));
      }
      table.rows.push_back(row);
    }
  }
  return table;
}

ReportTable Statuses(const std::vector<SceneOutcome>& outcomes,
                     const std::vector<VisionMethodKind>& methods) {
  ReportTable table{
      "Share of the frames in each status", {"method", "model", "ok", "degraded", "lost", "calibrating"}, {}};
  for (size_t i = 0; i < methods.size(); ++i) {
    for (const std::string& model : ModelsOf(outcomes)) {
      const VisionScore s = SumScores(outcomes, i, [&](const SceneOutcome& o) { return o.model == model; });
      Row row = {methods[i].name, model};
      for (const LinkStatus status :
           {LinkStatus::kOk, LinkStatus::kDegraded, LinkStatus::kLost, LinkStatus::kCalibrating})
        row.push_back(Share(s.statuses[static_cast<size_t>(status)], s.frames, 1));
      table.rows.push_back(row);
    }
  }
  return table;
}

// Characters, not bytes.
size_t Width(const std::string& text) {
  return static_cast<size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace

VisionScore SumScores(const std::vector<SceneOutcome>& outcomes, size_t method) {
  return SumScores(outcomes, method, [](const SceneOutcome&) { return true; });
}

std::vector<ReportTable> VisionTables(const std::vector<SceneOutcome>& outcomes,
                                      const std::vector<VisionMethodKind>& methods) {
  std::vector<ReportTable> tables = {AllScenes(outcomes, methods)};
  for (size_t i = 0; i < methods.size(); ++i) tables.push_back(ByCategory(outcomes, i, methods[i].name));
  tables.push_back(Covariances(outcomes, methods));
  tables.push_back(Times(outcomes, methods));
  tables.push_back(Statuses(outcomes, methods));
  return tables;
}

std::string AlignedText(const ReportTable& table) {
  std::vector<size_t> widths;
  for (const std::string& cell : table.header) widths.push_back(Width(cell));
  for (const Row& row : table.rows) {
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], Width(row[i]));
  }
  std::string text = table.title + "\n";
  const auto line = [&](const Row& row) {
    for (size_t i = 0; i < row.size(); ++i) {
      const std::string space(widths[i] - Width(row[i]), ' ');
      text += i == 0 ? row[i] + space : "  " + space + row[i];
    }
    text += "\n";
  };
  line(table.header);
  for (const Row& row : table.rows) line(row);
  return text;
}

std::string Markdown(const ReportTable& table) {
  std::string text = "### " + table.title + "\n\n";
  const auto line = [&](const Row& row) {
    for (const std::string& cell : row) text += "| " + cell + " ";
    text += "|\n";
  };
  line(table.header);
  for (size_t i = 0; i < table.header.size(); ++i) text += i == 0 ? "|---" : "|---:";
  text += "|\n";
  for (const Row& row : table.rows) line(row);
  return text;
}

}  // namespace taclink
