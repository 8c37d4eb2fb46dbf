#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>

#include "sensing/capture/decode.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_state.h"

namespace taclink {

/// Makes gray pictures of what cameras send, and says what is wrong with it. One thread.
class PictureStage {
 public:
  /// `rig`: what the pictures should be of. `may_repeat`: of files, and while rest pictures are taken, of
  /// which there may be one pair only; a camera that hangs then shows in the first frame that is measured.
  /// Writes the cameras' bad_picture.
  void Take(const StereoFrame& frame, const StereoRig& rig, bool may_repeat, LinkState& state);

  /// Of the last frame; 8 bits. What is not there is not to be used.
  bool has(size_t camera) const { return has_[camera]; }
  const cv::Mat& gray(size_t camera) const { return gray_[camera]; }
  /// Why one or both are not there; none: they are.
  const std::optional<Reason>& trouble() const { return trouble_; }

 private:
  std::optional<Reason> TroubleOf(CameraId id, const RawImage& image, const CameraModel& expected,
                                  bool may_repeat);

  std::array<GrayDecoder, kCameraCount> decoders_;
  std::array<cv::Mat, kCameraCount> gray_, before_;
  std::array<bool, kCameraCount> has_{};
  std::optional<Reason> trouble_;
};

}  // namespace taclink
