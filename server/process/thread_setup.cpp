#include "server/process/thread_setup.h"

#include <pthread.h>
#include <sched.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <cerrno>
#include <string>
#include <system_error>

namespace taclink::server {
namespace {

// Every link has two threads: one warning says it for all.
bool FirstTime(std::atomic<bool>& told) {
  return !told.exchange(true);
}

void SetPriority(int priority) {
  const sched_param param{.sched_priority = priority};
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param);
  static std::atomic<bool> told = false;
  if (error == 0 || !FirstTime(told)) return;
  const std::string reason = std::generic_category().message(error);
  if (error == EPERM) {
    SPDLOG_WARN(
        "no right to real-time priority {}: links run as usual. Grant CAP_SYS_NICE (setcap cap_sys_nice+ep "
        "taclinkd) or, under systemd, LimitRTPRIO={}",
        priority, priority);
  } else {
    SPDLOG_WARN("real-time priority {} can't be set: {}; links run as usual", priority, reason);
  }
}

void SetCpus(const std::vector<int>& cpus) {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::string list;
  for (const int cpu : cpus) {
    CPU_SET(static_cast<size_t>(cpu), &set);
    list += (list.empty() ? "" : ", ") + std::to_string(cpu);
  }
  const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
  static std::atomic<bool> told = false;
  if (error == 0 || !FirstTime(told)) return;
  SPDLOG_WARN(
      "threads can't be bound to CPUs {}: {}; they run on all. This machine, or the service's AllowedCPUs, "
      "has "
      "none of them",
      list, std::generic_category().message(error));
}

}  // namespace

void SetUpThread(const RealtimeOptions& options) {
  if (!options.cpus.empty()) SetCpus(options.cpus);
  if (options.priority > 0) SetPriority(options.priority);
}

}  // namespace taclink::server
