#pragma once

#include <string>
#include <vector>

#include "sensing/core/result.h"

namespace taclink {

/// Where a server listens: host:port, [ip6]:port or unix:path. Errors: kInvalidArgument, to be put behind
/// what the address is of.
Result<void> CheckListenAddress(const std::string& address);
/// Likewise without unix:path; empty: nowhere.
Result<void> CheckHttpListen(const std::string& address);
/// Whether only this machine can connect there.
bool IsLoopback(const std::string& address);

/// URLs with commas between, in their parts.
std::vector<std::string> SplitUrls(const std::string& urls);
/// Of NATS servers, without passwords; or empty. Errors: as CheckListenAddress.
Result<void> CheckNatsUrls(const std::string& urls);

}  // namespace taclink
