#include "sensing/simulation/played_scene.h"

namespace taclink {

CubicWeights CubicAt(const SkinKey& from, const SkinKey& to, double time_s) {
  const double span = to.time_s - from.time_s;
  const double s = (time_s - from.time_s) / span, r = 1 - s;
  return {static_cast<float>(r * r * (1 + 2 * s)), static_cast<float>(span * s * r * r),
          static_cast<float>(s * s * (3 - 2 * s)), static_cast<float>(-span * s * s * r)};
}

}  // namespace taclink
