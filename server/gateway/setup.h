#pragma once

#include <memory>

#include "sensing/core/result.h"
#include "server/arm/arm.h"
#include "server/config/options.h"
#include "server/gateway/gateway.h"
#include "server/publish/publisher.h"
#include "server/rpc/rpc_server.h"

namespace taclink::server {

/// The gateway of an arm's server, as configured. Null: it is off, or no address was configured and the usual
/// one is taken (which is logged). Arm, server and publisher (null: none) outlive it.
Result<std::unique_ptr<Gateway>> StartGateway(const HttpConfig& config, const Arm& arm, RpcServer& server,
                                              const std::shared_ptr<const Security>& security,
                                              const Publisher* publisher = nullptr);

/// What /metrics tells.
std::string MetricsOf(const Arm& arm, const RpcServer& server, const GatewayCounts& counts,
                      const Security& security, const Publisher* publisher = nullptr);

}  // namespace taclink::server
