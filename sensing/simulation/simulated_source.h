#pragma once

#include <array>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/scene_pace.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

/// What a user does to the skin now; asked for once a frame.
using HandlingNow = std::function<Handling()>;

/// Plays a scene as a pair of cameras would deliver it: YUYV, at the scene's rate at most. Frame k of the
/// scene has the sequence number k, whatever was skipped; another Start counts on.
class SimulatedSource final : public FrameSource {
 public:
  /// The cameras are the model's nominal ones, mounted as the scene says. Errors: kInvalidArgument (the scene
  /// does not fit the model).
  static Result<std::unique_ptr<SimulatedSource>> Make(const LinkModel& model, const Scene& scene,
                                                       Clock& clock, ScenePace pace = ScenePace::kClock,
                                                       HandlingNow handling = nullptr);

  Result<void> Start() override;  ///< from the scene's beginning
  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override;
  /// As a camera that exposes for 5 ms with gain 1 at first; there is no automatic exposure.
  Result<void> SetCamera(CameraId id, const CameraSettings& settings) override;
  void Remember(CameraId id, const CameraSettings& settings) override {
    static_cast<void>(SetCamera(id, settings));  // it took them before
  }
  SourceInfo Info() const override;
  bool WaitsForReader() const override { return pace_ == ScenePace::kFrames; }

  /// Of the last frame.
  const SkinTruth& truth() const { return truth_; }

 private:
  SimulatedSource(const LinkModel& model, Scene scene, Clock& clock, std::unique_ptr<SimulatedSkin> skin,
                  double took_s, ScenePace pace, HandlingNow handling);
  int64_t ExposureNs(uint64_t frame) const;
  uint64_t NextDue(int64_t now_ns);
  void DelayScene(uint64_t frame, int64_t now_ns);
  void Report(StereoFrame& frame) const;
  void Take(uint64_t frame_number, StereoFrame& frame);

  // Constant after construction.
  Scene scene_;
  Clock& clock_;
  const ScenePace pace_;
  const HandlingNow handling_;
  std::unique_ptr<SimulatedSkin> skin_;
  Renderer renderer_;
  std::string name_;  // for messages
  SourceInfo info_;
  // Changed by Start and Next.
  bool started_ = false;
  int64_t start_ns_ = 0;  // of frame 0; kFrames: moved by the caller's delays
  uint64_t next_frame_ = 0;
  uint64_t sequence_offset_ = 0;  // frames of earlier starts: the count goes on
  SkinTruth truth_;
  cv::Mat gray_;
  std::array<CameraSettings, kCameraCount> settings_;  // as set; all is set from the beginning
};

Result<std::unique_ptr<FrameSource>> MakeSimulatedSource(const LinkModel& model, const Scene& scene,
                                                         Clock& clock, ScenePace pace,
                                                         HandlingNow handling = nullptr);

}  // namespace taclink
