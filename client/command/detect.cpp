#include <algorithm>
#include <cstdio>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <string>

#include "client/command/commands.h"
#include "client/command/json.h"
#include "sensing/capture/image_io.h"
#include "sensing/markers/detector.h"

namespace taclink::command {
namespace {

struct DetectOptions {
  std::string picture;
  std::string draw;
  bool json = false;
};

cv::Mat Drawn(const cv::Mat& gray, const Detections& detections) {
  cv::Mat picture;
  cv::cvtColor(gray, picture, cv::COLOR_GRAY2BGR);
  constexpr int kShift = 4;  // sub-pixel drawing
  for (const Detection& d : detections) {
    const cv::Point center(static_cast<int>(d.center_px.x() * (1 << kShift)),
                           static_cast<int>(d.center_px.y() * (1 << kShift)));
    const cv::Size axes(static_cast<int>((d.width_px / 2 + 1) * (1 << kShift)),
                        static_cast<int>((d.height_px / 2 + 1) * (1 << kShift)));
    const cv::Scalar color = d.clipped ? cv::Scalar(0, 160, 255) : cv::Scalar(80, 220, 0);
    cv::ellipse(picture, center, axes, 0, 0, 360, color, 1, cv::LINE_AA, kShift);
  }
  return picture;
}

Result<void> Detect(const DetectOptions& options) {
  const auto gray = ReadGrayImage(options.picture);
  if (!gray) return gray.error();
  MarkerDetector detector;
  Detections detections;
  detector.Detect(*gray, detections);
  if (!options.draw.empty()) {
    if (auto written = WritePng(options.draw, Drawn(*gray, detections)); !written) return written.error();
  }
  if (options.json) {
    Json markers = Json::array();
    for (const Detection& d : detections) {
      markers.push_back({{"x", d.center_px.x()},
                         {"y", d.center_px.y()},
                         {"width", d.width_px},
                         {"height", d.height_px},
                         {"sigma_px", d.sigma_px()}});
    }
    std::puts(Json({{"markers", markers}}).dump().c_str());
  } else {
    const auto clipped =
        std::count_if(detections.begin(), detections.end(), [](const auto& d) { return d.clipped; });
    std::printf("%zu markers, %td of them clipped by the picture's edge\n", detections.size(), clipped);
  }
  return {};
}

}  // namespace

void AddDetect(CLI::App& app, Selected& selected) {
  auto options = std::make_shared<DetectOptions>();
  CLI::App* command = app.add_subcommand("detect", "Find markers in any picture");
  command->add_option("picture", options->picture, "PNG or JPEG")->required();
  command->add_option("--draw", options->draw, "Write the picture with the markers drawn into it (PNG)");
  command->add_flag("--json", options->json, "One JSON object, pixels");
  command->callback([options, &selected] { selected = [options] { return Detect(*options); }; });
}

}  // namespace taclink::command
