#pragma once

#include <string>

#include "foxglove/scene.pb.h"
#include "foxglove/transform.pb.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"

namespace taclink::wire::log {

/// The skin as triangles between the markers, red where nodal forces press, and an arrow for each contact:
/// along its force, its head on the skin, kArrowMetresPerNewton long. Nothing measured: both are deleted.
void Fill(const std::string& link, const MarkerGrid& grid, const LinkState& state, int64_t utc_ns,
          foxglove::SceneUpdate& out);
inline constexpr double kArrowMetresPerNewton = 0.05;

/// Where a link sits in the arm's base frame.
void Fill(const std::string& link, const Rigid3& base_from_link, int64_t utc_ns,
          foxglove::FrameTransform& out);

}  // namespace taclink::wire::log
