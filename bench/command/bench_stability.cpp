#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/benchmarks.h"
#include "bench/stability/stability_cases.h"
#include "bench/vision/vision_report.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

struct BenchStabilityOptions {
  std::string markdown, only;
  int refinement = 2, jobs = 1;
};

std::string Short(double value) {
  if (!std::isfinite(value)) return std::isnan(value) ? "-" : "inf";
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", value);
  return text;
}

void Tell(const StabilityRow& row) {
  std::fprintf(stderr, "%-60s %s: %s\n", row.name.c_str(), Name(row.ending), row.reason.c_str());
}

using RunCase = std::function<std::vector<StabilityRow>(const SkinCase&)>;

std::vector<StabilityRow> RunAll(const std::vector<SkinCase>& cases, int jobs, const RunCase& run) {
  std::vector<std::vector<StabilityRow>> by_case(cases.size());
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  const auto work = [&] {
    for (size_t i = next++; i < cases.size(); i = next++) {
      by_case[i] = run(cases[i]);
      const std::lock_guard lock(mutex);
      for (const StabilityRow& row : by_case[i]) Tell(row);
    }
  };
  std::vector<std::thread> workers;
  for (int i = 1; i < jobs; ++i) workers.emplace_back(work);
  work();
  for (std::thread& worker : workers) worker.join();
  std::vector<StabilityRow> rows;
  for (auto& each : by_case) std::move(each.begin(), each.end(), std::back_inserter(rows));
  return rows;
}

ReportTable SkinTable(const std::vector<StabilityRow>& rows) {
  ReportTable table{"The forward solver: a skin inflated, then pressed by a sphere",
                    {"case", "ends", "condition", "backward error", "float error", "energy", "reciprocity",
                     "checks, or the reason"},
                    {}};
  for (const StabilityRow& row : rows)
    table.rows.push_back({row.name, Name(row.ending), Short(row.condition), Short(row.backward_error),
                          Short(row.float_error), Short(row.energy_error), Short(row.reciprocity),
                          row.reason});
  return table;
}

ReportTable PlainTable(const char* title, const std::vector<StabilityRow>& rows) {
  ReportTable table{title, {"case", "ends", "how"}, {}};
  for (const StabilityRow& row : rows) table.rows.push_back({row.name, Name(row.ending), row.reason});
  return table;
}

std::string Count(const std::vector<StabilityRow>& rows, const char* what) {
  const auto of = [&](Ending ending) {
    return std::count_if(rows.begin(), rows.end(), [&](const StabilityRow& r) { return r.ending == ending; });
  };
  char text[160];
  std::snprintf(text, sizeof text, "%s: %zu cases, %td right, %td refused, %td wrong.\n", what, rows.size(),
                of(Ending::kRight), of(Ending::kRefused), of(Ending::kWrong));
  return text;
}

Result<void> Stability(const BenchStabilityOptions& options) {
  if (auto good = CheckWritable({options.markdown}); !good) return good;
  const auto base = LoadLinkModel("cylinder");
  if (!base) return base.error();
  const auto chosen = [&](std::vector<SkinCase> cases) {
    std::erase_if(cases, [&](const SkinCase& c) { return c.name.find(options.only) == std::string::npos; });
    return cases;
  };
  const std::vector<StabilityRow> skins =
      RunAll(chosen(SkinCases(*base)), options.jobs,
             [&](const SkinCase& skin) { return std::vector{RunSkinCase(skin, options.refinement)}; });
  const std::vector<StabilityRow> live = RunAll(chosen(LiveCases(*base)), options.jobs, RunLiveCase);
  const std::vector<StabilityRow> pictures =
      RunAll(chosen(PictureCases(*base)), options.jobs, RunPictureCase);
  std::vector<StabilityRow> inputs;
  if (options.only.empty()) inputs = RunInputCases(*base, Tell);
  std::string markdown = "Mesh of the forward solver of refinement " + std::to_string(options.refinement) +
                         ".\n\n" + Count(skins, "Forward solver") + "\n" + Count(live, "Live path") + "\n" +
                         Count(pictures, "Whole way") + "\n" + Count(inputs, "Input") + "\n";
  std::printf("%s", markdown.c_str());
  for (const ReportTable& table :
       {SkinTable(skins), PlainTable("The live path: skins, pressures and bodies", live),
        PlainTable("The whole way from pictures: labels, calibration, tracking, shape and force", pictures),
        PlainTable("The live path: numbers that are none, markers that are gone", inputs)}) {
    std::printf("%s\n", AlignedText(table).c_str());
    markdown += Markdown(table) + "\n";
  }
  return WriteBetweenMarks(options.markdown, "taclink-bench stability", markdown);
}

}  // namespace

void AddBenchStability(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchStabilityOptions>();
  const Arguments stability =
      bench.AddCommand("stability", "The mechanics at extreme skins, loads and inputs, case by case");
  stability.AddOption("--only", options->only, "Skins whose name holds this; without the inputs");
  stability.AddOption("--refinement", options->refinement, "Of the mesh").Must(Between(1, 4)).ShowDefault();
  stability.AddOption("--jobs", options->jobs, "Cases at the same time").Must(Between(1, 256));
  stability.AddOption("--markdown", options->markdown,
                      "File for the tables, or a page with marks to put them between");
  stability.OnChosen([options, &selected] { selected = [options] { return Stability(*options); }; });
}

}  // namespace taclink::command
