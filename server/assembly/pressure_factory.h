#pragma once

#include <memory>

#include "sensing/core/clock.h"
#include "server/config/config.h"
#include "server/pressure/pressure_source.h"
#include "server/simulation/simulated_regulator.h"

namespace taclink::server {

/// The simulated regulator of a link that is configured to have one; null: it has none.
std::shared_ptr<SimulatedRegulator> MakeSimulatedRegulator(const LinkConfig& link, Clock& clock);

/// The configured source of a link's pressure, not started. `regulator`: as MakeSimulatedRegulator.
std::unique_ptr<PressureSource> MakePressure(const LinkConfig& link, Clock& clock,
                                             std::shared_ptr<SimulatedRegulator> regulator);

}  // namespace taclink::server
