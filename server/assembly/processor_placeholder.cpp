#include "server/assembly/processor_factory.h"

namespace taclink::server {

// Until the pipeline is built: a frame's times and a status that says so.
Result<FrameProcessor> MakeProcessor(const LinkConfig&, const LinkModel&) {
  return FrameProcessor([](const StereoFrame& frame, LinkState& state) {
    state.times = frame.times;
    state.status = LinkStatus::kCalibrating;
    state.status_reason = "this build has no pipeline";
  });
}

}  // namespace taclink::server
