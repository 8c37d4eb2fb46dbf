#pragma once

#include <array>

#include "taclink/v1/geometry.pb.h"

namespace taclink {

/// Messages as tests write them.
inline void Set(const std::array<double, 3>& values, v1::Vector3& out) {
  out.set_x(values[0]);
  out.set_y(values[1]);
  out.set_z(values[2]);
}

}  // namespace taclink
