#pragma once

#include <functional>
#include <memory>

namespace taclink {

/// By how much `make` and what it returns enlarge a process' resident memory, MB; measured in a child
/// process. 0: it could not be measured. Call while there is one thread.
double ResidentGrowthMb(const std::function<std::shared_ptr<void>()>& make);

}  // namespace taclink
