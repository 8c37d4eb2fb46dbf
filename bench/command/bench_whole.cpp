#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/bench_methods.h"
#include "bench/command/benchmarks.h"
#include "bench/vision/vision_report.h"
#include "bench/whole/whole_bench.h"
#include "bench/whole/whole_report.h"
#include "bench/whole/whole_scenes.h"
#include "client/command/cli/json.h"

namespace taclink::command {
namespace {

struct BenchWholeOptions {
  std::string model = "all", only, markdown, svg, json;
  std::vector<std::string> force_models = {"auto"};
  std::vector<int> refinements = {0};
  int jobs = 1;
  bool frames = false, sound = false;
};

std::string NameOf(const WholeOutcome& outcome) {
  const ForceMethod& method = outcome.method;
  return outcome.scene->scene.name + ", " + method.name() +
         (method.refinement > 0 ? " on mesh " + method.mesh() : "");
}

void TellOutcome(const WholeOutcome& outcome) {
  if (!outcome.failure.empty())
    return static_cast<void>(std::fprintf(stderr, "%s\n", outcome.failure.c_str()));
  const WholeSummary sum = Summarize({&outcome});
  const std::string name = NameOf(outcome);
  std::fprintf(stderr, "%-50s %3d frames, %3d ok, %3d right, %3d silently wrong\n", name.c_str(), sum.frames,
               sum.ok, sum.right, sum.silent);
}

const char* StatusText(const WholeFrame& frame) {
  if (frame.status == LinkStatus::kOk) return "ok";
  if (frame.status == LinkStatus::kCalibrating) return "calibrating";
  return frame.has_forces ? "degraded" : "no forces";
}

void TellFrames(const WholeOutcome& outcome) {
  for (const WholeFrame& frame : outcome.frames) {
    std::string reasons;
    for (const ReasonId id : frame.reasons) reasons += std::string(" ") + Name(id);
    std::printf("%8.3f s  %s%s  worst marker %.2f mm%s  %s\n", frame.time_s, StatusText(frame),
                reasons.c_str(), frame.worst_marker_mm,
                frame.is_silent  ? "  SILENTLY WRONG"
                : frame.is_right ? ""
                                 : "  not right",
                frame.how.c_str());
  }
}

Json FrameJson(const WholeFrame& frame) {
  Json reasons = Json::array();
  for (const ReasonId id : frame.reasons) reasons.push_back(Name(id));
  return {{"time_s", frame.time_s},
          {"status", StatusText(frame)},
          {"reasons", reasons},
          {"status_reason", frame.status_reason},
          {"has_forces", frame.has_forces},
          {"right", frame.is_right},
          {"silently_wrong", frame.is_silent},
          {"worst_marker_mm", frame.worst_marker_mm},
          {"bodies", frame.bodies},
          {"within_2_sigma", frame.within_2_sigma},
          {"pressing_n", frame.true_n},
          {"off_n", frame.off_n},
          {"cpu_ms", frame.cpu_ms},
          {"wrong", frame.how}};
}

// [{"scene", "kind", "link", "force_model", "refinement", "fault", "refusal", "failure", "frames": [FRAME]}].
Json OutcomesJson(const std::vector<WholeOutcome>& outcomes) {
  Json json = Json::array();
  for (const WholeOutcome& outcome : outcomes) {
    json.push_back({{"scene", outcome.scene->scene.name},
                    {"kind", outcome.scene->kind},
                    {"link", outcome.scene->model},
                    {"force_model", outcome.method.name()},
                    {"refinement", outcome.method.refinement},
                    {"fault", IsFault(*outcome.scene)},
                    {"refusal", outcome.refusal},
                    {"failure", outcome.failure},
                    {"frames", Json::array()}});
    for (const WholeFrame& frame : outcome.frames) json.back()["frames"].push_back(FrameJson(frame));
  }
  return json;
}

Result<std::vector<WholeScene>> Scenes(const std::vector<LinkModel>& models,
                                       const BenchWholeOptions& options) {
  std::vector<WholeScene> scenes;
  for (const LinkModel& model : models) {
    if (options.model != "all" && options.model != model.name) continue;
    for (WholeScene& scene : WholeScenes(model)) {
      if (scene.scene.name.find(options.only) == std::string::npos) continue;
      if (options.sound && IsFault(scene)) continue;
      scenes.push_back(std::move(scene));
    }
  }
  if (scenes.empty())
    return Error{ErrorCode::kInvalidArgument, "no scene of model '" + options.model + "' has '" +
                                                  options.only +
                                                  "' in its name; models are cylinder, barrel and all"};
  return scenes;
}

// Several methods are compared with each other; of one, each kind of scene is told.
std::vector<ReportTable> Tables(const std::vector<WholeOutcome>& outcomes, size_t methods) {
  return methods == 1 ? WholeTables(outcomes) : std::vector{WholeMethodTable(outcomes)};
}

Result<void> Whole(const BenchWholeOptions& options) {
  if (auto good = CheckWritable({options.markdown, options.svg, options.json}); !good) return good;
  const auto methods = ForceMethods(options.force_models, options.refinements);
  if (!methods) return methods.error();
  const auto models = LoadBenchModels("all");
  if (!models) return models.error();
  const auto scenes = Scenes(*models, options);
  if (!scenes) return scenes.error();
  const auto outcomes =
      RunWholeBench(*models, *scenes, {.methods = *methods, .jobs = options.jobs, .done = TellOutcome});
  std::string markdown;
  for (const ReportTable& table : Tables(outcomes, methods->size())) {
    std::printf("%s\n", AlignedText(table).c_str());
    markdown += Markdown(table) + "\n";
  }
  if (options.frames) {
    for (const WholeOutcome& outcome : outcomes) {
      std::printf("%s\n", NameOf(outcome).c_str());
      TellFrames(outcome);
    }
  }
  const std::string command =
      methods->size() == 1 ? "taclink-bench whole" : "taclink-bench whole --force-models";
  if (auto written = WriteBetweenMarks(options.markdown, command, markdown); !written) return written;
  if (auto written = WriteText(options.svg, WholeMethodPlot(outcomes)); !written) return written;
  return WriteText(options.json, options.json.empty() ? "" : OutcomesJson(outcomes).dump(1) + "\n");
}

}  // namespace

void AddBenchWhole(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchWholeOptions>();
  const Arguments whole = bench.AddCommand(
      "whole", "From pictures to forces with default settings, undisturbed and with every fault");
  whole.AddOption("--model", options->model, "cylinder, barrel or all").ShowDefault();
  whole.AddOption("--only", options->only, "Scenes whose name holds this");
  whole.AddFlag("--sound", options->sound, "Only scenes in which nothing is wrong with the link");
  whole
      .AddOption("--force-models", options->force_models,
                 "Compare them, comma-separated: literal, linear, pressurised, nonlinear, auto")
      .Delimiter(',')
      .ShowDefault();
  whole
      .AddOption("--refinements", options->refinements,
                 "Compare meshes: elements per interval of the marker grid; 0: as links have")
      .Delimiter(',')
      .Must(Between(0, 3))
      .ShowDefault();
  whole.AddFlag("--frames", options->frames, "What became of every frame");
  whole.AddOption("--jobs", options->jobs, "Scenes at the same time").Must(Between(1, 256));
  whole.AddOption("--markdown", options->markdown,
                  "File for the tables, or a page with marks to put them between");
  whole.AddOption("--svg", options->svg, "File for the plot of error against time");
  whole.AddOption("--json", options->json, "File for all numbers, frame by frame");
  whole.OnChosen([options, &selected] { selected = [options] { return Whole(*options); }; });
}

}  // namespace taclink::command
