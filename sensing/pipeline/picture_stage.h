#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>

#include "sensing/capture/decode.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_state.h"
#include "sensing/pipeline/image_noise.h"
#include "sensing/pipeline/temporal_smoothing.h"

namespace taclink {

/// What an image that repeats the one before means.
enum class ImageRepeats : uint8_t {
  kAllowed,  ///< nothing: images come from files or a simulation
  kAtRest,   ///< nothing either: there may be one rest pair only. How images differ is learned
  kFault     ///< the camera hangs
};

/// Makes gray pictures of what cameras send, and says what is wrong with it. One thread.
class PictureStage {
 public:
  /// `rig`: what the pictures should be of. Writes the cameras' bad_picture.
  /// `is_rest`: the skin is at rest, as rest pairs are taken.
  void Take(const StereoFrame& frame, const StereoRig& rig, ImageRepeats repeats, bool is_rest,
            LinkState& state);

  /// Of the last frame; 8 bits. What is not there is not to be used.
  bool has(size_t camera) const { return has_[camera]; }
  const cv::Mat& gray(size_t camera) const { return gray_[camera]; }
  /// Why one or both are not there; none: they are.
  const std::optional<Reason>& trouble() const { return trouble_; }
  /// What is wrong with a camera whose picture is there.
  const std::optional<Reason>& warning() const { return warning_; }

 private:
  std::optional<Reason> TroubleOf(CameraId id, const RawImage& image, const CameraModel& expected,
                                  ImageRepeats repeats, int64_t exposure_ns);
  std::optional<Reason> RateReason(CameraId id) const;
  std::optional<Reason> SmoothingReason(CameraId id) const;

  std::array<GrayDecoder, kCameraCount> decoders_;
  std::array<ImageRepetition, kCameraCount> repetitions_;
  std::array<TemporalSmoothing, kCameraCount> smoothing_;
  std::array<cv::Mat, kCameraCount> gray_;
  std::array<bool, kCameraCount> has_{};
  std::optional<Reason> trouble_, warning_;
};

}  // namespace taclink
