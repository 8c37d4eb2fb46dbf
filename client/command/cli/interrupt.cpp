#include "client/command/cli/interrupt.h"

#include <atomic>
#include <csignal>

namespace taclink::command {
namespace {

std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

}  // namespace

void CatchInterrupts() {
  interrupted = false;
  std::signal(SIGINT, [](int) { interrupted = true; });
  std::signal(SIGTERM, [](int) { interrupted = true; });
}

bool IsInterrupted() {
  return interrupted;
}

}  // namespace taclink::command
