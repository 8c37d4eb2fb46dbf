#pragma once

#include "server/pressure/pressure_controller.h"
#include "taclink/v1/pressure.pb.h"

namespace taclink::server {

/// `options`: of the same regulator.
void Fill(const RegulatorStatus& status, const RegulatorOptions& options, v1::PressureRegulator& out);

}  // namespace taclink::server
