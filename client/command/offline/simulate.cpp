#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <system_error>

#include "client/command/cli/commands.h"
#include "client/command/cli/progress.h"
#include "sensing/capture/image_io.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_skin.h"
#include "sensing/simulation/truth_json.h"

namespace taclink::command {
namespace {

struct SimulateOptions {
  std::string scene;
  std::string out;
  std::string model;
  int frames = 0;
};

std::string PictureName(CameraId id, uint64_t frame) {
  char name[64];
  std::snprintf(name, sizeof name, "%s_%06llu.png", Name(id), static_cast<unsigned long long>(frame));
  return name;
}

Result<void> WritePictures(Renderer& renderer, const SkinTruth& truth, const std::filesystem::path& folder,
                           bool rest) {
  cv::Mat gray;
  for (const CameraId id : kBothCameras) {
    renderer.Render(truth, id, gray);
    const std::string name = rest ? std::string("rest_") + Name(id) + ".png" : PictureName(id, truth.frame);
    if (auto written = WritePng((folder / name).string(), gray); !written) return written.error();
  }
  return {};
}

// The untouched, unpressurised skin, whatever the scene begins with.
Result<void> WriteRest(const LinkModel& model, Scene scene, Renderer& renderer,
                       const std::filesystem::path& folder) {
  scene.contacts.clear();
  scene.pressure = {{0, 0}};
  auto skin = SimulatedSkin::Make(model, scene);
  if (!skin) return skin.error();
  SkinTruth truth;
  (*skin)->Evaluate(0, truth);
  return WritePictures(renderer, truth, folder, true);
}

Result<void> Simulate(const SimulateOptions& options) {
  const auto scene = LoadScene(options.scene);
  if (!scene) return scene.error();
  const auto model = LoadLinkModel(options.model.empty() ? scene->model : options.model);
  if (!model) return model.error();
  auto skin = [&] {
    Progress progress("the scene's equilibria");
    return SimulatedSkin::Make(*model, *scene, [&](double share) { progress.Show(share); });
  }();
  if (!skin) return skin.error();

  const std::filesystem::path folder(options.out);
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  std::ofstream truth_file(folder / "truth.jsonl");
  if (failed || !truth_file) {
    return Error{ErrorCode::kInvalidArgument, options.out + ": cannot be written; choose another --out"};
  }
  Renderer renderer(*model, MountedRig(model->nominal_rig, scene->camera), scene->camera, scene->seed);
  if (auto written = WriteRest(*model, *scene, renderer, folder); !written) return written.error();

  const int all = static_cast<int>(std::ceil(scene->duration_s * scene->frame_rate_hz));
  const int frames = options.frames > 0 ? options.frames : all;
  const auto rest = model->RestMarkers();
  SkinTruth truth;
  Progress progress("the scene");
  for (int frame = 0; frame < frames; ++frame) {
    progress.Show(static_cast<double>(frame) / frames);
    (*skin)->Evaluate(frame / scene->frame_rate_hz, truth);
    if (auto written = WritePictures(renderer, truth, folder, false); !written) return written.error();
    WriteTruthLine(truth, rest, truth_file);
  }
  truth_file.flush();
  if (!truth_file) return Error{ErrorCode::kUnavailable, options.out + ": the disk is full"};
  if (const std::string prepared = (*skin)->Preparation(); !prepared.empty())
    std::printf("skin: %s\n", prepared.c_str());
  std::printf("%d picture pairs, rest_top.png, rest_bottom.png and truth.jsonl in %s\n", frames,
              options.out.c_str());
  return {};
}

}  // namespace

void AddSimulate(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<SimulateOptions>();
  const Arguments command =
      app.AddCommand("simulate", "Write the pictures of both cameras and the truth of a scene");
  command.AddOption("--scene", options->scene, "Scene: a shipped name or a YAML file").Required();
  command.AddOption("--out", options->out, "Folder, made if it is not there").Required();
  command.AddOption("--model", options->model, "Link model instead of the scene's");
  command.AddOption("--frames", options->frames, "So many instead of the scene's duration").Must(Positive());
  command.OnChosen([options, &selected] { selected = [options] { return Simulate(*options); }; });
}

}  // namespace taclink::command
