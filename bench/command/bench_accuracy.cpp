#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/bench_methods.h"
#include "bench/command/benchmarks.h"
#include "bench/force/accuracy_report.h"
#include "client/command/cli/json.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

constexpr double kDetailNoiseMm = 0.05;

struct BenchAccuracyOptions {
  std::string model = "cylinder";
  std::vector<std::string> force_models;
  std::vector<int> refinements = {0, 1, 2};
  std::vector<double> noises_mm = {0, kDetailNoiseMm, 0.1};
  std::vector<double> pressures_kpa = {0, 0.5, 1, 1.5};
  std::vector<std::string> kinds;
  int truth_refinement = 4;
  std::string truth;
  int frames = 4, jobs = 1;
  uint64_t seed = 1;
  bool quick = false;
  std::string markdown, svg, json;
};

Result<std::vector<PressPath>> Paths(const LinkModel& model, const BenchAccuracyOptions& options) {
  std::vector<double> pressures = options.pressures_kpa;
  if (options.quick) pressures = {0, 1};
  for (double& pressure : pressures) pressure *= 1e-3;
  std::vector<PressPath> paths = PressPaths(model, pressures);
  std::vector<std::string> kinds = options.kinds;
  if (options.quick && kinds.empty()) kinds = {"rest", "stamp-marker", "two"};
  if (kinds.empty()) return paths;
  for (const std::string& kind : kinds) {
    const bool there =
        std::any_of(paths.begin(), paths.end(), [&](const auto& p) { return Name(p.kind) == kind; });
    if (!there) return Error{ErrorCode::kInvalidArgument, "no kind of scene '" + kind + "'"};
  }
  std::erase_if(paths, [&](const PressPath& path) {
    return std::find(kinds.begin(), kinds.end(), Name(path.kind)) == kinds.end();
  });
  return paths;
}

std::function<void(int, int)> Progress(const std::string& what) {
  return [what](int done, int all) {
    std::fprintf(stderr, "\r%s %d of %d%s", what.c_str(), done, all, done == all ? "\n" : "");
  };
}

Json SceneJson(const SceneScores& scene) {
  Json json = {{"name", scene.path->path.name},
               {"depth_mm", scene.truth->stage.depth_mm},
               {"drag_mm", scene.truth->stage.drag_mm},
               {"frames", Json::array()}};
  for (const FrameScore& frame : scene.frames) {
    Json contacts = Json::array();
    for (const ContactScore& c : frame.contacts)
      contacts.push_back({{"true_n", c.true_n},
                          {"size_error_n", c.size_error_n},
                          {"vector_error_n", c.vector_error_n},
                          {"direction_deg", c.direction_deg},
                          {"center_mm", c.center_mm},
                          {"force_deviations", c.force_deviations},
                          {"center_deviations", c.center_deviations},
                          {"missed", c.missed}});
    json["frames"].push_back(
        {{"phantom_n", frame.phantom_n}, {"stray_n", frame.stray_n}, {"contacts", contacts}});
  }
  return json;
}

Json OutcomeJson(const AccuracyOutcome& outcome) {
  Json json = {{"force_model", outcome.method.name()},
               {"refinement", outcome.method.refinement},
               {"link", outcome.model},
               {"noise_mm", outcome.noise_mm},
               {"answered", outcome.answered},
               {"frames", outcome.frames},
               {"not_converged", outcome.not_converged},
               {"construction_s", outcome.construction_s},
               {"memory_mb", outcome.memory_mb},
               {"cpu_ms",
                {{"p50", Percentile(outcome.cpu_ms, 0.5)},
                 {"p95", Percentile(outcome.cpu_ms, 0.95)},
                 {"p99", Percentile(outcome.cpu_ms, 0.99)},
                 {"at_rest_p50", Percentile(outcome.rest_cpu_ms, 0.5)}}},
               {"scenes", Json::array()}};
  for (const SceneScores& scene : outcome.scenes) json["scenes"].push_back(SceneJson(scene));
  return json;
}

struct Run {
  std::vector<std::vector<PathTruth>> truths;  // by link
  std::vector<AccuracyOutcome> outcomes;
};

Result<Run> Play(const std::vector<LinkModel>& models, const BenchAccuracyOptions& options) {
  auto methods = ForceMethods(options.force_models, options.refinements);
  if (!methods) return methods.error();
  Run run;
  for (const LinkModel& model : models) {
    const auto paths = Paths(model, options);
    if (!paths) return paths.error();
    auto truths = MakeTruths(model, *paths, options.truth_refinement, options.truth, options.jobs,
                             Progress("truth, " + model.name + ": path"));
    if (!truths) return truths.error();
    run.truths.push_back(std::move(*truths));
    AccuracyOptions bench{.methods = *methods,
                          .noises_mm = options.noises_mm,
                          .frames = options.frames,
                          .seed = options.seed,
                          .jobs = options.jobs,
                          .progress = Progress("force models: run")};
    for (AccuracyOutcome& outcome : RunAccuracyBench(model, run.truths.back(), bench))
      run.outcomes.push_back(std::move(outcome));
  }
  return run;
}

std::string Settings(const Run& run, const BenchAccuracyOptions& options) {
  int scenes = 0, left_out = 0, paths = 0;
  double cpu_s = 0;
  for (const auto& truths : run.truths) {
    for (const PathTruth& truth : truths) {
      const int there = ScenesOf(truth);
      scenes += there;
      left_out += truth.path.scenes() - there;
      cpu_s += truth.cpu_s;
      ++paths;
    }
  }
  char text[320];
  std::snprintf(text, sizeof text,
                "%d scenes on %d paths (%d more left out, see below), truth at refinement %d (%.1f CPU "
                "seconds a path), %d noisy frames a scene (2 exact ones), seed %llu.\n\n",
                scenes, paths, left_out, options.truth_refinement, paths > 0 ? cpu_s / paths : 0.0,
                options.frames, static_cast<unsigned long long>(options.seed));
  return text;
}

double DetailNoise(const BenchAccuracyOptions& options) {
  const auto& noises = options.noises_mm;
  const bool there = std::find(noises.begin(), noises.end(), kDetailNoiseMm) != noises.end();
  return there ? kDetailNoiseMm : noises.back();
}

Result<void> Accuracy(const BenchAccuracyOptions& options) {
  if (auto good = CheckWritable({options.markdown, options.svg, options.json}); !good) return good;
  const auto models = LoadBenchModels(options.model);
  if (!models) return models.error();
  // Outcomes point into the truths, whose places moving a Run does not change.
  const auto run = Play(*models, options);
  if (!run) return run.error();
  const double detail = DetailNoise(options);
  std::vector<ReportTable> tables = AccuracyTables(run->outcomes, detail);
  for (const auto& truths : run->truths) {
    if (ReportTable failed = FailedPaths(truths); !failed.rows.empty()) tables.push_back(failed);
  }
  std::string markdown = Settings(*run, options);
  std::printf("%s", markdown.c_str());
  for (const ReportTable& table : tables) {
    std::printf("%s\n", AlignedText(table).c_str());
    markdown += Markdown(table) + "\n";
  }
  if (auto written = WriteBetweenMarks(options.markdown, "taclink-bench accuracy", markdown); !written)
    return written.error();
  if (auto written = WriteText(options.svg, AccuracyPlot(run->outcomes, detail)); !written)
    return written.error();
  if (options.json.empty()) return {};
  Json json = {
      {"seed", options.seed}, {"truth_refinement", options.truth_refinement}, {"runs", Json::array()}};
  for (const AccuracyOutcome& outcome : run->outcomes) json["runs"].push_back(OutcomeJson(outcome));
  return WriteText(options.json, json.dump(1) + "\n");
}

void AddScenes(const Arguments& command, BenchAccuracyOptions& options) {
  command.AddOption("--model", options.model, "cylinder, barrel, all, or a YAML file").ShowDefault();
  command.AddOption("--pressures-kpa", options.pressures_kpa, "Gauge pressures of the scenes")
      .Delimiter(',')
      .Must(Within(-5, 5))
      .ShowDefault();
  command.AddOption("--kinds", options.kinds, "Some kinds of scenes, comma-separated").Delimiter(',');
  command.AddFlag("--quick", options.quick, "A few scenes at 0 and 1 kPa");
  command.AddOption("--truth-refinement", options.truth_refinement, "Of the truth's mesh")
      .Must(Between(1, 8))
      .ShowDefault();
  command.AddOption("--truth", options.truth,
                    "Folder that keeps the truth; delete it when the solver changed");
}

}  // namespace

void AddBenchAccuracy(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchAccuracyOptions>();
  const Arguments accuracy = bench.AddCommand(
      "accuracy", "From marker displacements to contact forces, against the nonlinear forward solver");
  AddScenes(accuracy, *options);
  accuracy.AddOption("--force-models", options->force_models, "Some of them, comma-separated").Delimiter(',');
  accuracy
      .AddOption("--refinements", options->refinements,
                 "Elements per interval of the marker grid; 0: as links have")
      .Delimiter(',')
      .Must(Between(0, 4))
      .ShowDefault();
  accuracy.AddOption("--noise", options->noises_mm, "Standard deviations of the markers, mm; 0: exact")
      .Delimiter(',')
      .Must(Within(0, 5))
      .ShowDefault();
  accuracy.AddOption("--frames", options->frames, "Noisy frames a scene")
      .Must(Between(1, 1000))
      .ShowDefault();
  accuracy.AddOption("--jobs", options->jobs, "Paths or force models at the same time").Must(Between(1, 256));
  accuracy.AddOption("--seed", options->seed, "Of the noise").ShowDefault();
  accuracy.AddOption("--markdown", options->markdown,
                     "File for the tables, or a page with marks to put them between");
  accuracy.AddOption("--svg", options->svg, "File for the plot of error against time");
  accuracy.AddOption("--json", options->json, "File for all numbers");
  accuracy.OnChosen([options, &selected] { selected = [options] { return Accuracy(*options); }; });
}

}  // namespace taclink::command
