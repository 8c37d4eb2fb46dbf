#pragma once

#include "sensing/core/geometry.h"

namespace taclink {

/// Vectors of random numbers, drawn in this order: arguments of a call every compiler evaluates in its own,
/// and the same seed would give another scene.
template <typename Draw>
Vec2 DrawnVec2(Draw&& draw) {
  const double y = draw();
  return {draw(), y};
}

template <typename Draw>
Vec3 DrawnVec3(Draw&& draw) {
  const double z = draw();
  const double y = draw();
  return {draw(), y, z};
}

}  // namespace taclink
