#include "sensing/pipeline/picture_calibration.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/rest_labels.h"
#include "sensing/pipeline/image_noise.h"
#include "sensing/pipeline/rest_match.h"
#include "sensing/pipeline/rest_pose.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink {
namespace {

// Of one image, saved twice; images of two cameras have independent noise.
constexpr double kSameNoise = 0.9;
constexpr const char* kRefused = "calibration refused: ";
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
    complete = pose.Add(pair, first_pair, guesses, rest.skin);
    if (complete) continue;
    const std::string& message = complete.error().message;
    return message.starts_with(kRefused) ? complete.error() : Refusal(message);
  }
  return *pose.result();
}

// Exactly, or but for compression.
bool ShowTheSame(const cv::Mat& top, const cv::Mat& bottom) {
  if (AreIdentical(top, bottom)) return true;
  NoiseSample one, other;
  one.Take(top);
  other.Take(bottom);
  const auto correlation = NoiseSample::Correlation(one, other);
  return correlation && *correlation > kSameNoise;
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
    if (ShowTheSame(pairs[i][0], pairs[i][1]))
      return Refusal("the top and the bottom picture of pair " + std::to_string(i + 1) +
                     " are the same image; give one of each camera");
  }
  CalibrationOptions rest_of_way = options;
  if (options.progress) {
    rest_of_way.progress = [&options](const CalibrationProgress& one) {
      options.progress({0.3 + 0.6 * one.done, one.step});
    };
  }
  auto result = Calibrate(model, detections, pairs.front(), rest, rest_of_way);
  if (options.progress) options.progress({1, "done"});
  return result;
}

Result<CalibrationSummary> CalibrateFromPictures(const LinkModel& model, std::span<const RestPictures> pairs,
                                                 const CalibrationOptions& options) {
  const auto estimator = MakeStateEstimator(model, {});
  auto result = CalibrateFromPictures(model, pairs, {.loads = {}, .skin = estimator->AtRest()}, options);
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
