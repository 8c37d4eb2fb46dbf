#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>

#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// A simulated link to which one scene after another happens: images of a skin through a pipeline whose state
/// lasts from one scene to the next. The exposures go on from where the last scene ended. One thread.
class PlayedLink {
 public:
  struct Built {
    LinkModel model;             ///< as the skin really is
    CameraEffects effects = {};  ///< likewise the cameras
    LinkModel known;             ///< as the pipeline is told
    PipelineOptions options = {};
    double pressure_gain = 1;  ///< of the sensor
    uint64_t seed = 1;
  };
  explicit PlayedLink(const Built& built);

  using Watch = std::function<void(const SkinTruth& truth, const LinkState& state)>;
  /// From the scene's start to its end. Errors: as SimulatedSkin::Make.
  Result<void> Play(const Scene& scene, const Watch& watch = {});

 private:
  void Process(int64_t exposure_ns);

  const LinkModel model_;
  const double pressure_gain_;
  LinkPipeline link_;
  Renderer renderer_;
  int64_t time_ns_ = 1'000'000'000;
  SkinTruth truth_;
  StereoFrame frame_;
  LinkState state_;
  cv::Mat gray_;
};

}  // namespace taclink
