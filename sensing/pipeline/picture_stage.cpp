#include "sensing/pipeline/picture_stage.h"

#include <string>

#include "sensing/pipeline/reason_text.h"

namespace taclink {
std::optional<Reason> PictureStage::TroubleOf(CameraId id, const RawImage& image, const CameraModel& expected,
                                              ImageRepeats repeats, int64_t exposure_ns) {
  const auto i = Index(id);
  const std::string camera = std::string(Name(id)) + " camera";
  if (!image.valid)
    return Reason{ReasonId::kCamera, "no picture from the " + camera +
                                         (image.why_missing.empty() ? "" : ": " + image.why_missing)};
  if (auto decoded = decoders_[i].Decode(image, gray_[i]); !decoded)
    return Reason{ReasonId::kCamera, camera + ": " + decoded.error().message};
  const cv::Mat& gray = gray_[i];
  if (gray.cols != expected.width_px || gray.rows != expected.height_px)
    return Reason{ReasonId::kCamera, camera + ": the picture is " + std::to_string(gray.cols) + "x" +
                                         std::to_string(gray.rows) + ", the camera's model is for " +
                                         std::to_string(expected.width_px) + "x" +
                                         std::to_string(expected.height_px)};
  if (repeats == ImageRepeats::kAllowed) return std::nullopt;
  repetitions_[i].Take(gray, exposure_ns, repeats == ImageRepeats::kAtRest);
  if (repeats == ImageRepeats::kFault && repetitions_[i].is_repeated()) {
    if (auto rate = RateReason(id)) return rate;
    return Reason{
        ReasonId::kFrozen,
        camera +
            ": the image, or its noise, is that of an image before, which a sensor never repeats: the "
            "camera or its driver hangs; plug it in again"};
  }
  return std::nullopt;
}

std::optional<Reason> PictureStage::RateReason(CameraId id) const {
  const auto rates = repetitions_[Index(id)].rates();
  if (!rates) return std::nullopt;
  return Reason{
      ReasonId::kFrameRate,
      ReasonText("the %s camera gives %.1f new images a second, but the link takes %.1f: the others are "
                 "repeated; set both cameras to one frame rate, and check exposure time and USB bandwidth",
                 Name(id), rates->new_hz, rates->all_hz),
      rates->new_hz, rates->all_hz};
}

std::optional<Reason> PictureStage::SmoothingReason(CameraId id) const {
  const auto share = smoothing_[Index(id)].share();
  if (!share) return std::nullopt;
  return Reason{
      ReasonId::kTemporalSmoothing,
      ReasonText("the %s camera blends each image with at least %.0f %% of the one before (temporal noise "
                 "reduction): "
                 "a moving skin is shown between two moments; switch it off: look for 3DNR, TNR, temporal or "
                 "noise reduction among the controls of v4l2-ctl --list-ctrls-menus; then take the rest "
                 "shape again",
                 Name(id), 100 * *share),
      *share, TemporalSmoothing::kLeastShare};
}

void PictureStage::Take(const StereoFrame& frame, const StereoRig& rig, ImageRepeats repeats, bool is_rest,
                        LinkState& state) {
  trouble_.reset();
  warning_.reset();
  for (const CameraId id : kBothCameras) {
    const RawImage& image = frame.images[Index(id)];
    const auto trouble = TroubleOf(id, image, rig[id], repeats, frame.times.exposure_monotonic_ns);
    has_[Index(id)] = !trouble;
    if (trouble && trouble->id == ReasonId::kCamera) repetitions_[Index(id)].Miss();
    if (!trouble) smoothing_[Index(id)].Take(gray_[Index(id)], is_rest);
    if (!trouble && repeats == ImageRepeats::kFault && !warning_) warning_ = RateReason(id);
    if (!trouble && !is_rest && !warning_) warning_ = SmoothingReason(id);
    state.cameras[Index(id)].bad_picture = trouble && image.valid && trouble->id == ReasonId::kCamera;
    if (trouble && trouble_)
      trouble_->text += "; " + trouble->text;
    else if (trouble)
      trouble_ = trouble;
  }
  if (repeats == ImageRepeats::kAllowed || !has_[0] || !has_[1] || !AreIdentical(gray_[0], gray_[1])) return;
  has_ = {};
  trouble_ = Reason{ReasonId::kCamera,
                    "both cameras give the same image: one device stands for both, or one sends the other's; "
                    "check which devices the link's top and bottom camera are"};
}

}  // namespace taclink
