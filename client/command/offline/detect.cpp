#include <algorithm>
#include <cstdio>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <string>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "sensing/capture/image_io.h"
#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/picture_labels.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

struct DetectOptions {
  std::string picture;
  std::string draw;
  bool json = false;
  std::string model, camera = "auto";
};

constexpr int kShift = 4;  // sub-pixel drawing

cv::Point AtSubPixel(const Vec2& p) {
  return {static_cast<int>(p.x() * (1 << kShift)), static_cast<int>(p.y() * (1 << kShift))};
}

cv::Mat Drawn(const cv::Mat& gray, const Detections& detections) {
  cv::Mat picture;
  cv::cvtColor(gray, picture, cv::COLOR_GRAY2BGR);
  for (const Detection& d : detections) {
    const cv::Point axes = AtSubPixel({d.width_px / 2 + 1, d.height_px / 2 + 1});
    const cv::Scalar color = d.clipped ? cv::Scalar(0, 160, 255) : cv::Scalar(80, 220, 0);
    cv::ellipse(picture, AtSubPixel(d.center_px), {axes.x, axes.y}, 0, 0, 360, color, 1, cv::LINE_AA, kShift);
  }
  return picture;
}

// Twice as large; a colour for each path, the ring's number beside each marker that has room for it.
cv::Mat DrawnLabels(const cv::Mat& gray, const LinkModel& model, const PictureLabels& labels) {
  const double scale = 2;
  cv::Mat picture, hues(1, model.markers.paths, CV_8UC3), colors;
  cv::resize(gray, picture, {}, scale, scale, cv::INTER_CUBIC);
  picture *= 0.6;
  cv::cvtColor(picture, picture, cv::COLOR_GRAY2BGR);
  for (int l = 0; l < model.markers.paths; ++l) {  // neighbours far apart on the colour circle
    hues.at<cv::Vec3b>(l) = cv::Vec3b(static_cast<uint8_t>(l * 67 % 180), 190, 255);
  }
  cv::cvtColor(hues, colors, cv::COLOR_HSV2BGR);
  std::vector<const PictureMarker*> last(static_cast<size_t>(model.markers.paths), nullptr);
  const auto in_picture = [scale](const Vec2& p) { return Vec2((scale * (p.array() + 0.5) - 0.5).matrix()); };
  for (const PictureMarker& m : labels.markers) {
    const int path = model.PathOf(m.marker);
    const cv::Scalar color(colors.at<cv::Vec3b>(path));
    const Vec2 center = in_picture(m.detection.center_px);
    if (const PictureMarker*& before = last[static_cast<size_t>(path)]; before == nullptr) {
      before = &m;
    } else {
      cv::line(picture, AtSubPixel(in_picture(before->detection.center_px)), AtSubPixel(center), color, 1,
               cv::LINE_AA, kShift);
      before = &m;
    }
    cv::circle(picture, AtSubPixel(center), 2 << kShift, color, m.looked_again ? 1 : -1, cv::LINE_AA, kShift);
    if (m.detection.area_px2 < 40) continue;
    const Vec2 inward = (labels.grid.center_px() - m.detection.center_px).normalized();
    const Vec2 beside = center + (0.5 * m.detection.width_px * scale + 6) * Vec2(-inward.y(), inward.x());
    cv::putText(picture, std::to_string(model.RingOf(m.marker) + 1),
                {static_cast<int>(beside.x()) - 6, static_cast<int>(beside.y()) + 4},
                cv::FONT_HERSHEY_SIMPLEX, 0.38, color, 1, cv::LINE_AA);
  }
  return picture;
}

struct Labelled {
  CameraId camera = CameraId::kBottom;
  bool camera_assumed = false;
  PictureLabels labels;
};

// Without being told, the camera whose nominal lens and rings the picture suits clearly better; a link that
// is symmetric from end to end looks the same to both, then it is taken to be the bottom one.
Result<Labelled> LabelFor(const DetectOptions& options, const LinkModel& model, const Detections& detections,
                          const cv::Mat& gray) {
  if (options.camera != "auto") {
    const CameraId id = options.camera == "top" ? CameraId::kTop : CameraId::kBottom;
    auto labels = LabelPicture(model, id, detections, gray);
    if (!labels) return labels.error();
    return Labelled{id, false, *std::move(labels)};
  }
  auto top = LabelPicture(model, CameraId::kTop, detections, gray);
  auto bottom = LabelPicture(model, CameraId::kBottom, detections, gray);
  if (!top && !bottom) return bottom.error();
  if (!bottom) return Labelled{CameraId::kTop, false, *std::move(top)};
  if (!top) return Labelled{CameraId::kBottom, false, *std::move(bottom)};
  const double misfits[] = {top->grid.lens_misfit(), bottom->grid.lens_misfit()};
  if (2 * misfits[0] < misfits[1]) return Labelled{CameraId::kTop, false, *std::move(top)};
  return Labelled{CameraId::kBottom, 2 * misfits[1] >= misfits[0], *std::move(bottom)};
}

Json DetectionJson(const Detection& d) {
  return {{"x", d.center_px.x()},
          {"y", d.center_px.y()},
          {"width", d.width_px},
          {"height", d.height_px},
          {"sigma_px", d.sigma_px()}};
}

Result<void> DetectLabelled(const DetectOptions& options, const cv::Mat& gray, const Detections& detections) {
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  const auto found = LabelFor(options, *model, detections, gray);
  if (!found) return found.error();
  if (!options.draw.empty()) {
    if (auto written = WritePng(options.draw, DrawnLabels(gray, *model, found->labels)); !written)
      return written.error();
  }
  if (!options.json) {
    std::printf("%zu of %d markers labelled, %s camera%s\n", found->labels.markers.size(),
                model->markers.count(), Name(found->camera),
                found->camera_assumed ? " (assumed: the picture suits both; --camera says which)" : "");
    return {};
  }
  Json markers = Json::array();
  for (const PictureMarker& m : found->labels.markers) {
    Json marker = DetectionJson(m.detection);
    marker["path"] = model->PathOf(m.marker) + 1;
    marker["ring"] = model->RingOf(m.marker) + 1;
    markers.push_back(std::move(marker));
  }
  std::puts(
      Json({{"camera", Name(found->camera)}, {"camera_assumed", found->camera_assumed}, {"markers", markers}})
          .dump()
          .c_str());
  return {};
}

Result<void> Detect(const DetectOptions& options) {
  const auto gray = ReadGrayImage(options.picture);
  if (!gray) return gray.error();
  MarkerDetector detector;
  Detections detections;
  detector.Detect(*gray, detections);
  if (!options.model.empty()) return DetectLabelled(options, *gray, detections);
  if (!options.draw.empty()) {
    if (auto written = WritePng(options.draw, Drawn(*gray, detections)); !written) return written.error();
  }
  if (options.json) {
    Json markers = Json::array();
    for (const Detection& d : detections) markers.push_back(DetectionJson(d));
    std::puts(Json({{"markers", markers}}).dump().c_str());
  } else {
    const auto clipped =
        std::count_if(detections.begin(), detections.end(), [](const auto& d) { return d.clipped; });
    std::printf("%zu markers, %td of them clipped by the picture's edge\n", detections.size(), clipped);
  }
  return {};
}

}  // namespace

void AddDetect(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<DetectOptions>();
  const Arguments command = app.AddCommand("detect", "Find markers in any picture");
  command.AddOption("picture", options->picture, "PNG or JPEG").Required();
  command.AddOption("--draw", options->draw, "Write the picture with the markers drawn into it (PNG)");
  command.AddOption("--model", options->model,
                    "Link model: a shipped one's name or a file. Only markers of its grid are kept, with "
                    "their path and ring; path 1 is the one nearest to where the model's rig sees it");
  command.AddOption("--camera", options->camera, "Whose picture it is, with --model")
      .Must(OneOf({"auto", "top", "bottom"}))
      .ShowDefault();
  command.AddFlag("--json", options->json, "One JSON object, pixels");
  command.OnChosen([options, &selected] { selected = [options] { return Detect(*options); }; });
}

}  // namespace taclink::command
