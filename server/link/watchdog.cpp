#include "server/link/watchdog.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/process/system_limits.h"

namespace taclink::server {

void Watchdog::Start(std::vector<LinkSupervisor*> links) {
  links_ = std::move(links);
  thread_ = MustStartThread("watchdog", [this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      Round();
      clock_.SleepUntilMonotonicNs(clock_.MonotonicNs() + std::chrono::nanoseconds(interval_).count());
    }
  });
}

void Watchdog::Stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void Watchdog::OnRound(std::function<void()> hook) {
  const std::lock_guard lock(mutex_);
  hook_ = std::move(hook);
}

void Watchdog::Round() {
  try {
    for (LinkSupervisor* link : links_) link->Check();
    const std::lock_guard lock(mutex_);
    if (hook_) hook_();
  } catch (const std::exception& e) {  // no memory, no thread: the next round may do better
    SPDLOG_ERROR("the watchdog could not look after the links: {}", DescribeLimit(e));
  }
}

}  // namespace taclink::server
