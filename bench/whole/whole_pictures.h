#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>

#include "bench/whole/whole_scenes.h"
#include "sensing/capture/encode.h"
#include "sensing/core/frame.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

/// What happens on another link while a scene is played.
Scene OtherLinksScene(const WholeScene& whole);

/// The pictures of a whole scene with its faults, and what is true about the skin in each.
class WholePictures {
 public:
  /// `model` and `skin`: the scene's; `other`: another link's, for crossed cameras. All must outlive this.
  WholePictures(const LinkModel& model, const WholeScene& whole, SimulatedSkin& skin, SimulatedSkin* other);

  /// Frame by frame, from 0. The next call overwrites both.
  void Take(int frame, StereoFrame& pictures, SkinTruth& truth);

 private:
  void Draw(Renderer& renderer, int frame, const SkinTruth& truth, CameraId id);
  std::optional<SpecificForceReading> MeasuredSpecificForce(const SkinTruth& truth) const;
  void Spoil(int frame, CameraId id, cv::Mat& gray);
  bool Repeats(int frame) const;
  int QualityOf(int frame) const;
  void Tear(int frame, CameraId id);
  void LoseMarkers(double time_s, SkinTruth& truth) const;

  const WholeScene& whole_;
  SimulatedSkin& skin_;
  SimulatedSkin* other_;
  AgingSkin aging_;
  Renderer renderer_, moved_;  // moved_: as the fault has it
  JpegEncoder encoder_;
  std::array<cv::Mat, kCameraCount> gray_, blended_;
  SkinTruth then_;
};

}  // namespace taclink
