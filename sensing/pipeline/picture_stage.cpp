#include "sensing/pipeline/picture_stage.h"

#include <algorithm>
#include <string>
#include <utility>

namespace taclink {
namespace {

// Stops at the first pixel that differs: of a sensor with noise, one of the first. Pictures without light
// need not have noise.
bool IsRepeated(const cv::Mat& now, const cv::Mat& before) {
  if (now.empty() || now.size() != before.size()) return false;
  bool is_uniform = true;
  for (int row = 0; row < now.rows; ++row) {
    const uchar* pixels = now.ptr(row);
    if (!std::equal(pixels, pixels + now.cols, before.ptr(row))) return false;
    is_uniform = is_uniform && std::all_of(pixels, pixels + now.cols,
                                           [&](uchar pixel) { return pixel == now.at<uchar>(0, 0); });
  }
  return !is_uniform;
}

}  // namespace

std::optional<Reason> PictureStage::TroubleOf(CameraId id, const RawImage& image, const CameraModel& expected,
                                              bool may_repeat) {
  const auto i = Index(id);
  const std::string camera = std::string(Name(id)) + " camera";
  if (!image.valid)
    return Reason{ReasonId::kCamera, "no picture from the " + camera +
                                         (image.why_missing.empty() ? "" : ": " + image.why_missing)};
  if (auto decoded = decoders_[i].Decode(image, before_[i]); !decoded)
    return Reason{ReasonId::kCamera, camera + ": " + decoded.error().message};
  std::swap(gray_[i], before_[i]);
  const cv::Mat& gray = gray_[i];
  if (gray.cols != expected.width_px || gray.rows != expected.height_px)
    return Reason{ReasonId::kCamera, camera + ": the picture is " + std::to_string(gray.cols) + "x" +
                                         std::to_string(gray.rows) + ", the camera's model is for " +
                                         std::to_string(expected.width_px) + "x" +
                                         std::to_string(expected.height_px)};
  if (!may_repeat && IsRepeated(gray, before_[i]))
    return Reason{
        ReasonId::kFrozen,
        camera +
            ": the picture is the one before, pixel by pixel, which a sensor's noise never repeats: "
            "the camera hangs; plug it in again"};
  return std::nullopt;
}

void PictureStage::Take(const StereoFrame& frame, const StereoRig& rig, bool may_repeat, LinkState& state) {
  trouble_.reset();
  for (const CameraId id : kBothCameras) {
    const RawImage& image = frame.images[Index(id)];
    const auto trouble = TroubleOf(id, image, rig[id], may_repeat);
    has_[Index(id)] = !trouble;
    state.cameras[Index(id)].bad_picture = trouble && image.valid && trouble->id == ReasonId::kCamera;
    if (trouble && trouble_)
      trouble_->text += "; " + trouble->text;
    else if (trouble)
      trouble_ = trouble;
  }
}

}  // namespace taclink
