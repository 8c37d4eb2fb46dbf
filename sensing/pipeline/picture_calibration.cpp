#include "sensing/pipeline/picture_calibration.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/rest_labels.h"
#include "sensing/pipeline/rest_match.h"
#include "sensing/pipeline/rest_pose.h"

namespace taclink {
namespace {

constexpr const char* kRefused = "calibration refused: ";
// Swapped pictures that fit are refused if they put the cameras nearer to the nominal ones by this much
// (difference of half the squared distance in tolerances).
constexpr double kSwapMargin = 6;
constexpr double kSwapDoubt = 12;  // stands for a pair that does not fit as given

Error Refusal(const std::string& what) {
  return {ErrorCode::kInvalidArgument, kRefused + what};
}

Result<void> CheckSize(const LinkModel& model, CameraId id, const cv::Mat& picture) {
  const CameraModel& camera = model.nominal_rig[id];
  if (picture.type() == CV_8UC1 && picture.cols == camera.width_px && picture.rows == camera.height_px)
    return {};
  return Refusal(std::string("the ") + Name(id) + " picture is " + std::to_string(picture.cols) + " x " +
                 std::to_string(picture.rows) + " px, but the model's camera sends " +
                 std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) +
                 "; take the pictures as the camera sends them, or correct the model's image_size_px");
}

Result<SettledCamera> Settle(const LinkModel& model, CameraId id, Detections detections,
                             const cv::Mat& picture, const CalibrationOptions& options) {
  const auto labels = LabelRestPicture(model, id, detections, picture);
  if (!labels) return Refusal(labels.error().message);
  auto settled = SettleCamera(model, id, *labels, detections, options.domes);
  if (!settled) {
    return Refusal(std::string("no camera explains the ") + Name(id) +
                   " picture: check that the model is this link's, and that nothing touches the skin");
  }
  return *std::move(settled);
}

Result<RestResult> Calibrate(const LinkModel& model, const std::vector<DetectionPair>& pairs,
                             const RestPictures& first_pair, const RestConditions& rest,
                             const CalibrationOptions& options) {
  RestPose pose(model, {}, static_cast<int>(pairs.size()), options);
  const std::vector<MeasuredLoads> guesses = RestGuesses(rest.loads);
  Result<bool> complete = false;
  for (const DetectionPair& pair : pairs) {
    complete = pose.Add(pair, first_pair, guesses, rest.shape_at);
    if (complete) continue;
    const std::string& message = complete.error().message;
    return message.starts_with(kRefused) ? complete.error() : Refusal(message);
  }
  return *pose.result();
}

// True if the pictures explain the model better the other way round.
bool LookSwapped(const LinkModel& model, std::vector<DetectionPair> pairs, RestPictures first_pair,
                 const Result<RestResult>& as_given, RestConditions rest, CalibrationOptions options) {
  for (auto& pair : pairs) std::swap(pair[0], pair[1]);
  std::swap(first_pair[0], first_pair[1]);
  options.progress = nullptr;
  if (as_given) rest.loads = as_given->loads;
  const auto swapped = Calibrate(model, pairs, first_pair, rest, options);
  if (!swapped) return false;
  return swapped->calibration.departure_cost + kSwapMargin <
         (as_given ? as_given->calibration.departure_cost : kSwapDoubt);
}

}  // namespace

Result<RestResult> CalibrateFromPictures(const LinkModel& model, std::span<const RestPictures> pairs,
                                         const RestConditions& rest, const CalibrationOptions& options) {
  if (pairs.empty()) return Refusal("no rest pictures given");
  MarkerDetector detector;
  std::vector<DetectionPair> detections(pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (options.progress) {
      options.progress(
          {0.3 * static_cast<double>(i) / static_cast<double>(pairs.size()),
           "find the markers of pair " + std::to_string(i + 1) + " of " + std::to_string(pairs.size())});
    }
    for (const CameraId id : kBothCameras) {
      const cv::Mat& picture = pairs[i][Index(id)];
      if (auto good = CheckSize(model, id, picture); !good) return good.error();
      detector.Detect(picture, detections[i][Index(id)]);
    }
  }
  CalibrationOptions rest_of_way = options;
  if (options.progress) {
    rest_of_way.progress = [&options](const CalibrationProgress& one) {
      options.progress({0.3 + 0.6 * one.done, one.step});
    };
  }
  auto result = Calibrate(model, detections, pairs.front(), rest, rest_of_way);
  if (options.progress) options.progress({0.9, "try the pictures the other way round"});
  if (LookSwapped(model, detections, pairs.front(), result, rest, options)) {
    return Refusal(
        "the pictures look swapped: they fit the model with top as bottom and bottom as top; give them the "
        "other "
        "way round");
  }
  if (options.progress) options.progress({1, "done"});
  return result;
}

Result<CalibrationSummary> CalibrateFromPictures(const LinkModel& model, std::span<const RestPictures> pairs,
                                                 const CalibrationOptions& options) {
  const RestConditions weightless{.loads = {},
                                  .shape_at = [&](const MeasuredLoads&) { return RestShape(model); }};
  auto result = CalibrateFromPictures(model, pairs, weightless, options);
  if (!result) return result.error();
  return std::move(result->calibration);
}

Result<CameraCalibration> CalibrateFromPicture(const LinkModel& model, CameraId id, const cv::Mat& picture,
                                               const CalibrationOptions& options) {
  if (auto good = CheckSize(model, id, picture); !good) return good.error();
  MarkerDetector detector;
  Detections detections;
  detector.Detect(picture, detections);
  const auto settled = Settle(model, id, detections, picture, options);
  if (!settled) return settled.error();
  return CalibrateCamera(model, id, settled->match.markers, options);
}

}  // namespace taclink
