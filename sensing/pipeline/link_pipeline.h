#pragma once

#include <memory>
#include <optional>

#include "sensing/camera/calibration.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/result.h"

namespace taclink {

struct PipelineOptions {
  /// Camera parameters of this very link; none: found from the first rest picture.
  std::optional<StereoRig> rig;
  /// Gauge pressure where the source does not measure it.
  double pressure_mpa = 0;
  /// Contacts weaker than this are not reported.
  double min_contact_force_n = 0.02;
};

/// The whole way from two pictures to contacts, for one link: the list of its stages is `Process`. One
/// thread.
class LinkPipeline {
 public:
  LinkPipeline(const LinkModel& model, const PipelineOptions& options);
  ~LinkPipeline();
  LinkPipeline(LinkPipeline&&) noexcept;

  /// Takes one pair through all stages. Until there is a baseline, pairs are taken as rest pictures (status
  /// kCalibrating). `state`'s buffers are reused. Never fails: what is wrong is in the state's status and
  /// reason.
  void Process(const StereoFrame& frame, LinkState& state);

  /// Takes this pair as the rest shape: finds the cameras if they are not known, and the baseline.
  /// Errors: kInvalidArgument (too few markers, bad fit), with the reason.
  Result<void> SetRest(const StereoFrame& frame);

  const LinkModel& model() const;
  /// Empty before the cameras are known.
  const std::optional<StereoRig>& rig() const;

 private:
  struct Stages;
  std::unique_ptr<Stages> stages_;
};

}  // namespace taclink
