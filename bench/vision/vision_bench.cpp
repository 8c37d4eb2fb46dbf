#include "bench/vision/vision_bench.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "sensing/shell/linear_shell.h"
#include "sensing/simulation/linear_skin.h"
#include "sensing/simulation/renderer.h"

namespace taclink {
namespace {

struct Link {
  const LinkModel* model;
  std::shared_ptr<const LinearShell> shell;
};
using Links = std::map<std::string, Link>;

Links MakeLinks(const std::vector<LinkModel>& models, const std::vector<EvaluationScene>& scenes,
                int refinement) {
  Links links;
  for (const LinkModel& model : models) {
    const bool used = std::any_of(scenes.begin(), scenes.end(),
                                  [&](const EvaluationScene& scene) { return scene.model == model.name; });
    if (used) links[model.name] = {&model, std::make_shared<const LinearShell>(model, refinement)};
  }
  return links;
}

// A worker's methods, by model: some take a second to make.
using MethodPool = std::map<std::string, std::vector<std::unique_ptr<VisionMethod>>>;

Result<SceneOutcome> Play(const Link& link, const EvaluationScene& scene, const VisionBenchOptions& options,
                          MethodPool& pool) {
  const LinkModel& model = *link.model;
  auto skin = LinearSkin::Make(model, scene.scene, link.shell);
  if (!skin) return skin.error();
  const StereoRig rig = MountedRig(model.nominal_rig, scene.scene.camera);
  Renderer renderer(model, rig, scene.scene.camera, scene.scene.seed);
  auto& methods = pool[model.name];
  std::vector<VisionScorer> scorers;
  for (size_t i = 0; i < options.methods.size(); ++i) {
    if (methods.size() <= i) methods.push_back(options.methods[i].make(model));
    methods[i]->Restart();
    scorers.emplace_back(model);
  }
  std::vector<VisionResult> results(methods.size());
  SkinTruth skin_truth;
  VisionTruth truth;
  StereoFrame pictures;
  std::array<cv::Mat, kCameraCount> gray;
  for (int frame = 0; frame < scene.frames; ++frame) {
    (*skin)->Evaluate(frame / scene.scene.frame_rate_hz, skin_truth);
    for (const CameraId id : kBothCameras) {
      renderer.Render(skin_truth, id, gray[Index(id)]);
      PackYuyv(gray[Index(id)], renderer.chroma(id), pictures.images[Index(id)]);
    }
    pictures.sequence = static_cast<uint64_t>(frame);
    pictures.times.exposure_monotonic_ns =
        static_cast<int64_t>((frame + 1) / scene.scene.frame_rate_hz * 1e9);  // 0 would be none
    pictures.pressure_mpa = skin_truth.pressure_mpa;
    for (size_t i = 0; i < methods.size(); ++i) methods[i]->Process(pictures, results[i]);
    MakeVisionTruth(model, rig, renderer, skin_truth, truth);
    for (size_t i = 0; i < methods.size() && frame >= kRestFrames; ++i) scorers[i].Add(truth, results[i]);
    if (options.on_frame) options.on_frame({scene, frame, pictures, gray, truth, results});
  }
  SceneOutcome outcome{scene.name, scene.category, scene.model, scene.frames, {}, {}};
  for (VisionScorer& scorer : scorers) {
    scorer.Finish();
    outcome.scores.push_back(scorer.score());
    outcome.incidents.push_back(scorer.incidents());
  }
  return outcome;
}

}  // namespace

Result<std::vector<SceneOutcome>> RunVisionBench(const std::vector<LinkModel>& models,
                                                 const std::vector<EvaluationScene>& scenes,
                                                 const VisionBenchOptions& options) {
  cv::setNumThreads(1);
  const Links links = MakeLinks(models, scenes, options.truth_refinement);
  std::vector<std::optional<SceneOutcome>> outcomes(scenes.size());
  std::optional<Error> error;
  std::mutex mutex;  // guards error and done
  int done = 0;
  std::atomic<size_t> next = 0;
  const auto work = [&] {
    MethodPool pool;
    for (size_t i = next++; i < scenes.size(); i = next++) {
      const auto link = links.find(scenes[i].model);
      auto outcome =
          link == links.end()
              ? Result<SceneOutcome>(Error{ErrorCode::kInvalidArgument,
                                           scenes[i].name + ": no model '" + scenes[i].model + "'"})
              : Play(link->second, scenes[i], options, pool);
      const std::lock_guard lock(mutex);
      if (!outcome) {
        if (!error) error = outcome.error();
        return;
      }
      outcomes[i] = std::move(*outcome);
      if (options.progress) options.progress(++done, static_cast<int>(scenes.size()));
    }
  };
  std::vector<std::thread> workers;
  for (int i = 1; i < options.jobs && !options.on_frame; ++i) workers.emplace_back(work);
  work();
  for (std::thread& worker : workers) worker.join();
  if (error) return *error;
  std::vector<SceneOutcome> result;
  for (auto& outcome : outcomes) result.push_back(std::move(*outcome));
  return result;
}

}  // namespace taclink
