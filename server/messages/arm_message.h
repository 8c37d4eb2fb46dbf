#pragma once

#include "server/arm/arm.h"
#include "taclink/v1/arm.pb.h"

namespace taclink::server {

/// What the arm is and how it does now.
void Fill(const Arm& arm, v1::Arm& out);

}  // namespace taclink::server
