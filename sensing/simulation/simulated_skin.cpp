#include "sensing/simulation/simulated_skin.h"

#include "sensing/simulation/linear_skin.h"
#include "sensing/simulation/nonlinear_skin.h"

namespace taclink {

Result<std::unique_ptr<SimulatedSkin>> SimulatedSkin::Make(const LinkModel& model, const Scene& scene) {
  if (scene.skin == SkinKind::kLinear) return LinearSkin::Make(model, scene);
  return NonlinearSkin::Make(model, scene);
}

}  // namespace taclink
