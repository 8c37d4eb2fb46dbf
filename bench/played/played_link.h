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

/// A simulated link that plays one scene after another: images of a skin pass through a pipeline whose state
/// persists between scenes. Exposures continue at the end of the previous scene. One thread.
class PlayedLink {
 public:
  struct Built {
    LinkModel model;             ///< the true skin
    CameraEffects effects = {};  ///< the true cameras
    LinkModel known;             ///< the model that the pipeline uses
    PipelineOptions options = {};
    double pressure_gain = 1;  ///< of the pressure sensor
    uint64_t seed = 1;
  };
  explicit PlayedLink(const Built& built);

  using Watch = std::function<void(const SkinTruth& truth, const LinkState& state)>;
  /// Plays the scene from start to end. Errors: as SimulatedSkin::Make.
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
