#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace taclink {

/// What `run` returns in a child process, at most 4000 characters of it; none: it crashed or took longer than
/// `most_s`. Call while there is one thread.
std::optional<std::string> InChildProcess(const std::function<std::string()>& run, int most_s);

/// By how much `make` and what it returns enlarge a process' resident memory, MB; measured in a child
/// process. 0: it could not be measured.
double ResidentGrowthMb(const std::function<std::shared_ptr<void>()>& make);

}  // namespace taclink
