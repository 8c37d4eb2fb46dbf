#include "sensing/simulation/simulated_skin.h"

#include "sensing/simulation/linear_skin.h"
#include "sensing/simulation/nonlinear_skin.h"

namespace taclink {

Result<std::unique_ptr<SimulatedSkin>> SimulatedSkin::Make(const LinkModel& model, const Scene& scene,
                                                           const SceneProgress& progress) {
  if (scene.skin == SkinKind::kLinear) return LinearSkin::Make(model, scene);
  return NonlinearSkin::Make(model, scene, progress);
}

}  // namespace taclink
