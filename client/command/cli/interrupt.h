#pragma once

#include <chrono>

namespace taclink::command {

/// From now on Ctrl-C and SIGTERM do not end the program, but what asks IsInterrupted.
void CatchInterrupts();
bool IsInterrupted();

/// So often a command that waits for its server asks.
inline constexpr std::chrono::milliseconds kInterruptPoll{100};

}  // namespace taclink::command
