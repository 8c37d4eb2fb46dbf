// Writes what the emulated cameras show: render_pictures SCENE FOLDER. For each frame of the scene and each
// camera top_000.jpg (MJPEG) and top_000.yuyv, and truth.csv: frame, force on the skin in x, y, z, N.
#include <turbojpeg.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>

#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

constexpr int kQuality = 92;

std::string FileName(CameraId id, uint64_t frame, const char* extension) {
  char name[64];
  std::snprintf(name, sizeof name, "%s_%03llu.%s", Name(id), static_cast<unsigned long long>(frame),
                extension);
  return name;
}

void WriteFile(const std::filesystem::path& path, const void* bytes, size_t size) {
  std::ofstream(path, std::ios::binary)
      .write(static_cast<const char*>(bytes), static_cast<std::streamsize>(size));
}

/// With both chroma planes, as cameras send it.
void WriteJpeg(const std::filesystem::path& path, const cv::Mat& gray) {
  const tjhandle handle = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  cv::Mat colour(gray.rows, gray.cols, CV_8UC3);
  for (int y = 0; y < gray.rows; ++y)
    for (int x = 0; x < gray.cols; ++x) colour.at<cv::Vec3b>(y, x) = cv::Vec3b::all(gray.at<uint8_t>(y, x));
  tjCompress2(handle, colour.data, gray.cols, 0, gray.rows, TJPF_BGR, &bytes, &size, TJSAMP_422, kQuality, 0);
  WriteFile(path, bytes, size);
  tjFree(bytes);
  tjDestroy(handle);
}

Result<void> Render(const std::string& scene_path, const std::filesystem::path& folder) {
  const auto scene = LoadScene(scene_path);
  if (!scene) return scene.error();
  const auto model = LoadLinkModel(scene->model);
  if (!model) return model.error();
  auto skin = SimulatedSkin::Make(*model, *scene);
  if (!skin) return skin.error();
  std::filesystem::create_directories(folder);
  std::ofstream truth_file(folder / "truth.csv");
  const Renderer renderer(*model, MountedRig(model->nominal_rig, scene->camera), scene->camera, scene->seed);
  const int frames = static_cast<int>(std::lround(scene->duration_s * scene->frame_rate_hz));
  SkinTruth truth;
  cv::Mat gray;
  RawImage yuyv;
  for (int frame = 0; frame < frames; ++frame) {
    (*skin)->Evaluate(frame / scene->frame_rate_hz, truth);
    Vec3 force = Vec3::Zero();
    for (const TrueContact& contact : truth.contacts) force += contact.force_n;
    truth_file << frame << ',' << force.x() << ',' << force.y() << ',' << force.z() << '\n';
    for (const CameraId id : kBothCameras) {
      renderer.Render(truth, id, gray);
      PackYuyv(gray, renderer.chroma(id), yuyv);
      WriteFile(folder / FileName(id, truth.frame, "yuyv"), yuyv.bytes.data(), yuyv.bytes.size());
      WriteJpeg(folder / FileName(id, truth.frame, "jpg"), gray);
    }
  }
  std::printf("%d picture pairs in %s\n", frames, folder.c_str());
  return {};
}

}  // namespace
}  // namespace taclink

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "render_pictures SCENE FOLDER\n"), 2;
  const auto rendered = taclink::Render(argv[1], argv[2]);
  if (!rendered) std::fprintf(stderr, "render_pictures: %s\n", rendered.error().message.c_str());
  return rendered ? 0 : 1;
}
