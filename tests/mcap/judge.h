#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "mcap/cursor.h"

namespace taclink::mcap::testing {

/// What is in a log, as judge.mjs prints it; {error} at the first error.
nlohmann::json DigestOf(Bytes bytes, MessageOrder order);

/// Runs judge.mjs (`mode`: read or write) on a folder. Empty, with a failure, where it does not run.
nlohmann::json RunJudge(const std::string& mode, const std::filesystem::path& folder);

}  // namespace taclink::mcap::testing
