#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/bench_json.h"
#include "bench/command/benchmarks.h"
#include "bench/vision/scene_generator.h"
#include "bench/vision/vision_bench.h"
#include "bench/vision/vision_report.h"
#include "sensing/capture/image_io.h"

namespace taclink::command {
namespace {

constexpr int kScenes = 216;
constexpr int kQuickScenes = 2 * kSceneCategoryCount;
constexpr int kWorstShown = 10;

struct VisionOptions {
  int scenes = kScenes;
  bool quick = false;
  uint64_t seed = 1;
  std::string model = "all";
  std::vector<std::string> methods;
  std::string scene;
  std::string keep;
  std::string json, markdown, svg;
  int jobs = 1;
};

Result<std::vector<VisionMethodKind>> ChooseMethods(const std::vector<std::string>& names) {
  std::vector<VisionMethodKind> chosen;
  if (names.empty()) {
    std::copy_if(VisionMethodKinds().begin(), VisionMethodKinds().end(), std::back_inserter(chosen),
                 [](const VisionMethodKind& kind) { return kind.by_default; });
  }
  for (const std::string& name : names) {
    std::string known;
    const size_t before = chosen.size();
    for (const VisionMethodKind& kind : VisionMethodKinds()) {
      if (kind.name == name) chosen.push_back(kind);
      known.append(known.empty() ? "" : ", ").append(kind.name);
    }
    if (chosen.size() == before)
      return Error{ErrorCode::kInvalidArgument, "no method '" + name + "'; there are " + known};
  }
  return chosen;
}

void PrintFrame(const BenchFrame& frame, const std::vector<VisionMethodKind>& methods) {
  if (frame.frame < kRestFrames - 1) return;
  for (size_t i = 0; i < methods.size(); ++i) {
    const VisionResult& result = frame.results[i];
    double squares = 0;
    int count = 0;
    for (size_t m = 0; m < result.shape.positions_mm.size(); ++m) {
      if (frame.truth.WholeIn(m) < 2) continue;
      squares += (result.shape.positions_mm[m] - frame.truth.positions_mm[m]).squaredNorm();
      ++count;
    }
    int labelled = 0;
    for (const auto& camera : result.labels.cameras)
      labelled +=
          static_cast<int>(std::count_if(camera.begin(), camera.end(), [](const auto& m) { return m.seen; }));
    std::printf("frame %3d  %-12s %4d labels  RMSE %.3f mm  %.2f ms  %s\n", frame.frame,
                methods[i].name.c_str(), labelled, count > 0 ? std::sqrt(squares / count) : 0.0,
                result.stage_ms.detect + result.stage_ms.register_ + result.stage_ms.reconstruct,
                result.status_reason.c_str());
  }
}

Result<void> KeepPictures(const BenchFrame& frame, const std::string& folder) {
  for (const CameraId id : kBothCameras) {
    char name[64];
    std::snprintf(name, sizeof name, "%s_%06d.png", Name(id), frame.frame);
    const auto path = std::filesystem::path(folder) / name;
    if (auto written = WritePng(path.string(), frame.gray[Index(id)]); !written) return written.error();
  }
  return {};
}

// What went wrong, worst first, so that it can be played again with --scene.
void PrintWorst(const std::vector<SceneOutcome>& outcomes, const std::vector<LinkModel>& models,
                const std::vector<VisionMethodKind>& methods) {
  for (size_t i = 0; i < methods.size(); ++i) {
    std::vector<const SceneOutcome*> order;
    order.reserve(outcomes.size());
    for (const SceneOutcome& outcome : outcomes) order.push_back(&outcome);
    const auto bad = [i](const SceneOutcome* o) {
      const auto& labels = o->scores[i].labels;
      return std::pair(labels[0].wrong + labels[1].wrong, o->incidents[i].worst_mm);
    };
    std::stable_sort(order.begin(), order.end(),
                     [&](const SceneOutcome* a, const SceneOutcome* b) { return bad(a) > bad(b); });
    std::printf("Worst scenes: %s\n", methods[i].name.c_str());
    for (size_t k = 0; k < std::min<size_t>(order.size(), kWorstShown); ++k) {
      const SceneOutcome& o = *order[k];
      const Incidents& what = o.incidents[i];
      const auto model =
          std::find_if(models.begin(), models.end(), [&](const auto& m) { return m.name == o.model; });
      std::printf("  %-26s wrong %lld  worst %.2f mm at marker (%d, %d), frame %llu%s%s\n", o.name.c_str(),
                  static_cast<long long>(bad(&o).first), what.worst_mm,
                  what.worst_marker < 0 ? 0 : model->PathOf(what.worst_marker) + 1,
                  what.worst_marker < 0 ? 0 : model->RingOf(what.worst_marker) + 1,
                  static_cast<unsigned long long>(what.worst_frame), what.labels.empty() ? "" : "; ",
                  what.labels.empty() ? "" : what.labels.front().c_str());
    }
  }
}

Result<std::vector<EvaluationScene>> ChooseScenes(const VisionOptions& options,
                                                  const std::vector<LinkModel>& models) {
  if (options.scene.empty())
    return GenerateScenes(models, options.quick ? kQuickScenes : options.scenes, options.seed);
  auto scene = GenerateScene(models, options.scene, options.seed);
  if (!scene) return scene.error();
  return std::vector<EvaluationScene>{std::move(*scene)};
}

std::string Settings(const std::vector<EvaluationScene>& scenes, const VisionOptions& options) {
  int frames = 0;
  for (const EvaluationScene& scene : scenes) frames += scene.frames - kRestFrames;
  return std::to_string(scenes.size()) + " scenes, " + std::to_string(frames) +
         " stereo pairs after the rest frames, seed " + std::to_string(options.seed) + ".\n\n";
}

Result<void> Vision(const VisionOptions& options) {
  if (auto good = CheckWritable({options.markdown, options.svg, options.json}); !good) return good;
  const auto models = LoadBenchModels(options.model);
  if (!models) return models.error();
  const auto methods = ChooseMethods(options.methods);
  if (!methods) return methods.error();
  const auto scenes = ChooseScenes(options, *models);
  if (!scenes) return scenes.error();
  std::optional<Error> keep_error;
  if (!options.keep.empty()) {
    std::error_code failed;
    std::filesystem::create_directories(options.keep, failed);
  }
  VisionBenchOptions bench{.methods = *methods, .jobs = options.jobs, .progress = {}, .on_frame = {}};
  bench.progress = [](int done, int all) {
    std::fprintf(stderr, "\rscene %d of %d%s", done, all, done == all ? "\n" : "");
  };
  if (!options.scene.empty()) {
    bench.on_frame = [&](const BenchFrame& frame) {
      PrintFrame(frame, *methods);
      if (options.keep.empty() || keep_error) return;
      if (auto kept = KeepPictures(frame, options.keep); !kept) keep_error = kept.error();
    };
  }
  const auto outcomes = RunVisionBench(*models, *scenes, bench);
  if (!outcomes) return outcomes.error();
  if (keep_error) return *keep_error;

  std::string markdown = Settings(*scenes, options);
  for (const ReportTable& table : VisionTables(*outcomes, *methods)) {
    std::printf("%s\n", AlignedText(table).c_str());
    markdown += Markdown(table) + "\n";
  }
  PrintWorst(*outcomes, *models, *methods);
  if (!options.scene.empty()) {
    for (size_t i = 0; i < methods->size(); ++i) {
      for (const std::string& label : outcomes->front().incidents[i].labels)
        std::printf("%s: %s\n", (*methods)[i].name.c_str(), label.c_str());
    }
  }
  if (auto written = WriteBetweenMarks(options.markdown, "taclink-bench vision", markdown); !written)
    return written.error();
  if (auto written = WriteText(options.svg, ErrorTimePlot(*outcomes, *methods)); !written)
    return written.error();
  if (options.json.empty()) return {};
  return WriteText(options.json, BenchJson(*outcomes, *methods, options.seed).dump(1) + "\n");
}

}  // namespace

void AddBenchVision(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<VisionOptions>();
  const Arguments vision =
      bench.AddCommand("vision", "From two pictures to marker positions, against the truth");
  vision.AddOption("--scenes", options->scenes, "How many").Must(Between(1, 100000)).ShowDefault();
  vision.AddFlag("--quick", options->quick, "One scene of each category and model");
  vision.AddOption("--seed", options->seed, "Of all scenes").ShowDefault();
  vision.AddOption("--model", options->model, "cylinder, barrel, all, or a YAML file").ShowDefault();
  vision.AddOption("--methods", options->methods, "Some of them, comma-separated; half only if named")
      .Delimiter(',');
  vision.AddOption("--scene", options->scene, "One scene by its name, frame by frame");
  vision.AddOption("--keep", options->keep, "Folder for the pictures of --scene").Needs("--scene");
  vision.AddOption("--json", options->json, "File for all numbers");
  vision.AddOption("--markdown", options->markdown,
                   "File for the tables, or a page with marks to put them between");
  vision.AddOption("--svg", options->svg, "File for the plot of error against time");
  vision.AddOption("--jobs", options->jobs, "Scenes at the same time").Must(Between(1, 256));
  vision.OnChosen([options, &selected] { selected = [options] { return Vision(*options); }; });
}

}  // namespace taclink::command
