#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>

#include "client/command/cli/json.h"
#include "client/command/cli/log_text.h"
#include "client/command/cli/progress.h"
#include "client/command/logs/log_tools.h"
#include "client/command/logs/solve_log.h"
#include "taclink/v1/frame.pb.h"
#include "wire/enum_names.h"

namespace taclink::command {
namespace {

struct LogSolveOptions {
  SolveLogOptions solve;
  std::string force_model;
  int force_refinement = -1;
  bool without_pictures = false, json = false;
};

const char* NameOf(BaselineOrigin origin) {
  switch (origin) {
    case BaselineOrigin::kStart:
      return "the rest shape of the first pictures";
    case BaselineOrigin::kCalibration:
      return "the rest shape of a calibration";
    case BaselineOrigin::kTare:
      return "a tare";
    case BaselineOrigin::kForcedTare:
      return "a forced tare";
    case BaselineOrigin::kNone:
      break;
  }
  return "nothing";
}

std::string TextOf(const Baseline& baseline) {
  return fmt::format("{} at {}", NameOf(baseline.origin),
                     UtcText(static_cast<uint64_t>(baseline.taken_utc_ns)));
}

double Speed(const LinkReport& link) {
  return link.solve_s > 0 ? link.recorded_s / link.solve_s : 0;
}

double MeanMs(const LinkReport& link) {
  return link.solved > 0 ? link.solve_s * 1e3 / static_cast<double>(link.solved) : 0;
}

void Print(const char* which, const FrameDifferences& off) {
  if (off.frames == 0) return;
  fmt::print("  {}: {} frames measured both times; ", which, off.frames);
  if (off.marker_mm.count > 0)
    fmt::print("a marker moved by {:.4g} mm on average, {:.4g} mm at most; ", off.marker_mm.mean(),
               off.marker_mm.most);
  fmt::print(
      "the total force by {:.4g} N on average, {:.4g} N at most; {} frames have another number of contacts\n",
      off.force_n.mean(), off.force_n.most, off.other_contacts);
}

void Print(const LinkReport& link) {
  fmt::print(
      "{}: {} of {} frames solved from {}, {} of them bit for bit as recorded; {:.2f} ms a frame, {:.1f} "
      "times "
      "as fast as they were taken\n",
      link.name, link.solved, link.frames, link.from_pictures ? "pictures" : "recorded markers",
      link.identical == link.solved && link.solved > 0 ? "all" : std::to_string(link.identical), MeanMs(link),
      Speed(link));
  for (const auto& [what, change] : link.changes) fmt::print("  {}: {}\n", what, change);
  for (const std::string& warning : link.warnings) fmt::print("  warning: {}\n", warning);
  if (link.lost > 0)
    fmt::print("  warning: {} frames were lost in recording; those after them may differ for that alone\n",
               link.lost);
  if (link.identical == link.solved) return;
  Print("difference", link.same_baseline);
  for (const BaselineBreak& at : link.breaks) {
    fmt::print("  from frame {} ({:.3f} s) on not comparable: recorded against {}, solved against {}\n",
               at.sequence, at.after_s, TextOf(at.recorded), TextOf(at.solved));
  }
  Print("against different baselines", link.other_baseline);
  if (link.only_recorded + link.only_solved > 0)
    fmt::print("  {} frames were measured only then, {} only now\n", link.only_recorded, link.only_solved);
}

Json DifferencesJson(const FrameDifferences& off) {
  return {{"frames", off.frames},
          {"marker_mean_mm", off.marker_mm.mean()},
          {"marker_max_mm", off.marker_mm.most},
          {"force_mean_n", off.force_n.mean()},
          {"force_max_n", off.force_n.most},
          {"other_contact_count", off.other_contacts}};
}

Json BaselineJson(const Baseline& baseline) {
  return {{"origin", NameOf(baseline.origin)}, {"taken_utc_ns", baseline.taken_utc_ns}};
}

Json LinkJson(const LinkReport& link) {
  Json breaks = Json::array();
  for (const BaselineBreak& at : link.breaks) {
    breaks.push_back({{"sequence", at.sequence},
                      {"after_s", at.after_s},
                      {"recorded", BaselineJson(at.recorded)},
                      {"solved", BaselineJson(at.solved)}});
  }
  return {{"link", link.name},
          {"from", link.from_pictures ? "pictures" : "markers"},
          {"changes", link.changes},
          {"warnings", link.warnings},
          {"frames", link.frames},
          {"frames_lost", link.lost},
          {"solved", link.solved},
          {"identical", link.identical},
          {"measured_only_then", link.only_recorded},
          {"measured_only_now", link.only_solved},
          {"difference", DifferencesJson(link.same_baseline)},
          {"not_comparable_from", std::move(breaks)},
          {"difference_of_other_baselines", DifferencesJson(link.other_baseline)},
          {"mean_solve_ms", MeanMs(link)},
          {"speed", Speed(link)}};
}

void Print(const SolveLogOptions& options, const SolveLogSummary& summary, bool json) {
  if (json) {
    Json links = Json::array();
    for (const LinkReport& link : summary.links) links.push_back(LinkJson(link));
    fmt::print("{}\n", Json({{"from", options.input},
                             {"log", options.output},
                             {"bytes", summary.bytes},
                             {"recorded_s", summary.recorded_s},
                             {"took_s", summary.wall_s},
                             {"jobs", summary.jobs},
                             {"links", std::move(links)}})
                           .dump());
    return;
  }
  for (const LinkReport& link : summary.links) Print(link);
  fmt::print("{}: {}; {:.1f} s of recording took {:.1f} s with {} {}\n", options.output,
             SizeText(summary.bytes), summary.recorded_s, summary.wall_s, summary.jobs,
             summary.jobs == 1 ? "thread" : "threads");
}

Result<void> Solve(const LogSolveOptions& options) {
  SolveLogOptions solve = options.solve;
  if (!options.force_model.empty()) solve.force_model = options.force_model;
  if (options.force_refinement >= 0) solve.force_refinement = options.force_refinement;
  solve.pictures = !options.without_pictures;
  const auto summary = [&solve] {
    Progress progress("the log");
    return SolveLog(solve, [&progress](uint64_t done, uint64_t all) {
      progress.Show(static_cast<double>(done) / static_cast<double>(all));
    });
  }();
  if (!summary) return summary.error();
  Print(solve, *summary, options.json);
  return {};
}

}  // namespace

void AddLogSolve(const Arguments& log, Selected& selected) {
  auto options = std::make_shared<LogSolveOptions>();
  const Arguments command = log.AddCommand(
      "solve", "Solve a log's pictures again, as they were or in another way, and say what changed");
  command.AddOption("file", options->solve.input, "The log, MCAP").Required();
  command.AddOption("-o,--output", options->solve.output, "The new log").Required();
  command.AddOption("--link", options->solve.links, "Names of links (default: all); others stay as they are");
  command
      .AddOption("--force-model", options->force_model,
                 "In place of the recorded one; auto: cheapest that is good enough")
      .Must(OneOf(wire::NamesOf<v1::ForceModel>().All()));
  command
      .AddOption("--force-refinement", options->force_refinement,
                 "Elements per interval of the marker grid; 0: auto")
      .Must(Between(0, 3));
  // One value each time: what follows may be the log's name.
  command
      .AddOption("--model", options->solve.models,
                 "Link model in place of the recorded one: FILE or LINK=FILE; may be repeated")
      .OneValueEach();
  command
      .AddOption("--calibration", options->solve.calibrations,
                 "Cameras in place of those recorded, or found in the first pictures: FILE or LINK=FILE; "
                 "may be repeated")
      .OneValueEach();
  command.AddOption("--jobs", options->solve.jobs, "Links solved at the same time (default: one a CPU)")
      .Must(Between(1, 1024));
  command.AddFlag("--without-pictures", options->without_pictures, "Leave the pictures out of the new log");
  command.AddFlag("--json", options->json, "One JSON object");
  command.OnChosen([options, &selected] { selected = [options] { return Solve(*options); }; });
}

}  // namespace taclink::command
