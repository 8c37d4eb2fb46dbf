#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/benchmarks.h"
#include "bench/sweep/sweep_bench.h"
#include "bench/sweep/sweep_report.h"
#include "client/command/offline/marker_map_svg.h"
#include "sensing/core/read_file.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

struct BenchSweepOptions {
  std::vector<std::string> models = {"cylinder", "barrel"};
  std::vector<double> pressures_kpa = {0, 0.5, 1};
  std::string csv, markdown, maps;
  int jobs = 1;
  bool report_only = false;
};

Result<std::vector<SweepContact>> ReadContacts(const std::string& path) {
  if (path.empty() || !std::filesystem::exists(path)) return std::vector<SweepContact>();
  const auto text = ReadFile(path, kMostTableBytes);
  if (!text) return text.error();
  auto contacts = ParseSweepCsv(*text);
  if (!contacts) return Error{contacts.error().code, path + ": " + contacts.error().message};
  return contacts;
}

// What is missing, unit by unit to the end of the file: a sweep that was interrupted goes on there.
Result<void> SweepRest(const std::vector<LinkModel>& models, const BenchSweepOptions& options,
                       std::vector<SweepContact>& contacts) {
  const auto done = UnitsOf(contacts);
  SweepOptions sweep{.units = {}, .jobs = options.jobs, .done = {}};
  for (SweepUnit& unit : SweepUnits(models, options.pressures_kpa)) {
    if (!done.contains(unit)) sweep.units.push_back(std::move(unit));
  }
  std::ofstream file;
  if (!options.csv.empty()) {
    file.open(options.csv, std::ios::trunc);
    file << SweepCsvHeader();
    for (const SweepContact& one : contacts) file << SweepCsvRow(one);
  }
  sweep.done = [&](const std::vector<SweepContact>& unit, const std::string& failure) {
    for (const SweepContact& one : unit) file << SweepCsvRow(one);
    file.flush();
    contacts.insert(contacts.end(), unit.begin(), unit.end());
    if (!failure.empty()) std::fprintf(stderr, "%s\n", failure.c_str());
    if (unit.empty()) return;
    const SweepUnit& of = unit.front().unit;
    const SweepSummary sum = SummarizeSweep(unit);
    std::fprintf(
        stderr,
        "%-10s %.1f kPa path %2d: %3zu contacts, %3zu ok, center %.1f / %.1f mm, force %.1f / %.1f %%\n",
        of.model.c_str(), of.pressure_kpa, of.path, sum.contacts, sum.ok, sum.center_mm.median,
        sum.center_mm.p95, 100 * sum.force_share.median, 100 * sum.force_share.p95);
  };
  RunSweep(models, sweep);
  if (!options.csv.empty() && !file)
    return Error{ErrorCode::kUnavailable, "cannot write '" + options.csv + "'"};
  return {};
}

Result<void> WriteMaps(const std::string& folder, const std::vector<LinkModel>& models,
                       const std::vector<SweepContact>& contacts) {
  for (const LinkModel& model : models) {
    std::map<double, std::vector<SweepContact>> by_pressure;
    for (const SweepContact& one : contacts) {
      if (one.unit.model == model.name) by_pressure[one.unit.pressure_kpa].push_back(one);
    }
    for (const auto& [kpa, group] : by_pressure) {
      for (const bool cells : {false, true}) {
        char name[96], where[96];
        std::snprintf(name, sizeof name, "%s/sweep-%s-%gkpa-%s", folder.c_str(), model.name.c_str(), kpa,
                      cells ? "cells" : "markers");
        std::snprintf(where, sizeof where, "%s, %g kPa, %s", model.name.c_str(), kpa,
                      cells ? "between markers" : "at markers");
        auto forces = WorstForceShare(model, group, cells);
        for (double& share : forces) share *= 100;
        const std::string force = MarkerMapSvg(
            model, {.title = std::string(where) + ": worst force error", .unit = "%", .values = forces});
        const std::string center = MarkerMapSvg(model, {.title = std::string(where) + ": worst center error",
                                                        .unit = "mm",
                                                        .values = WorstCenterMm(model, group, cells)});
        if (auto written = WriteText(std::string(name) + "-force.svg", force); !written) return written;
        if (auto written = WriteText(std::string(name) + "-center.svg", center); !written) return written;
      }
    }
  }
  return {};
}

Result<void> BenchSweep(const BenchSweepOptions& options) {
  if (auto good = CheckWritable({options.markdown}); !good) return good;
  std::vector<LinkModel> models;
  for (const std::string& name : options.models) {
    auto model = LoadLinkModel(name);
    if (!model) return model.error();
    models.push_back(*std::move(model));
  }
  auto contacts = ReadContacts(options.csv);
  if (!contacts) return contacts.error();
  *contacts = WholeUnits(models, *std::move(contacts));
  if (!options.report_only) {
    if (auto swept = SweepRest(models, options, *contacts); !swept) return swept;
  }
  const ReportTable table = SweepTable(*contacts);
  std::printf("%s\n", AlignedText(table).c_str());
  if (!options.maps.empty()) {
    if (auto written = WriteMaps(options.maps, models, *contacts); !written) return written;
  }
  return WriteBetweenMarks(options.markdown, "taclink-bench sweep", Markdown(table) + "\n");
}

}  // namespace

void AddBenchSweep(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchSweepOptions>();
  const Arguments command = bench.AddCommand(
      "sweep", "Press every marker's place and the cells between, to three depths, from images to forces");
  command.AddOption("--models", options->models, "Link models, comma-separated").Delimiter(',').ShowDefault();
  command.AddOption("--pressures-kpa", options->pressures_kpa, "Gauge pressures, comma-separated")
      .Delimiter(',')
      .Must(Within(-20, 20))
      .ShowDefault();
  command.AddOption("--csv", options->csv, "File for all contacts; one that exists is gone on with");
  command.AddFlag("--report-only", options->report_only, "Only report what the CSV file holds");
  command.AddOption("--markdown", options->markdown,
                    "File for the table, or a page with marks to put it between");
  command.AddOption("--maps", options->maps, "Folder for maps of the errors over the skin (SVG)");
  command.AddOption("--jobs", options->jobs, "Links at the same time").Must(Between(1, 256));
  command.OnChosen([options, &selected] { selected = [options] { return BenchSweep(*options); }; });
}

}  // namespace taclink::command
