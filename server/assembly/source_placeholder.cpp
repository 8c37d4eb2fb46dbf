#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_source.h"
#include "server/assembly/source_factory.h"

namespace taclink::server {

// Until the capture library is built: only the simulation.
Result<std::unique_ptr<FrameSource>> MakeSource(const LinkConfig& link, const LinkModel& model,
                                                Clock& clock) {
  const auto* config = std::get_if<SimulatedSourceConfig>(&link.source);
  if (config == nullptr)
    return Error{ErrorCode::kUnsupported, "this build has no capture; use source: simulated"};
  const auto scene = LoadScene(config->scene);
  if (!scene) return scene.error();
  return MakeSimulatedSource(model, *scene, clock);
}

}  // namespace taclink::server
