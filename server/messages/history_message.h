#pragma once

#include <vector>

#include "server/arm/arm.h"
#include "taclink/v1/history.pb.h"

namespace taclink::server {

/// What the arm keeps of the links that are `wanted` (by link; empty: all), from `span_s` before the newest
/// frame of each on; 0: a minute.
void Fill(Arm& arm, const std::vector<bool>& wanted, double span_s, v1::GetForceHistoryResponse& out);

}  // namespace taclink::server
