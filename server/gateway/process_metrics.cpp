#include "server/gateway/process_metrics.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>

namespace taclink::server {
namespace {

std::optional<size_t> Entries(const char* folder) {
  std::error_code error;
  const std::filesystem::directory_iterator begin(folder, error);
  if (error) return std::nullopt;
  return static_cast<size_t>(std::distance(begin, std::filesystem::directory_iterator()));
}

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
}

}  // namespace

void AddProcessMetrics(MetricsText& metrics) {
  rusage usage{};
  if (getrusage(RUSAGE_SELF, &usage) == 0)
    metrics.Counter("process_cpu_seconds_total", "CPU time, user and system")
        .Value(Seconds(usage.ru_utime) + Seconds(usage.ru_stime));
  double pages = 0, resident = 0;
  if (std::ifstream("/proc/self/statm") >> pages >> resident)
    metrics.Gauge("process_resident_memory_bytes", "Memory in use")
        .Value(resident * static_cast<double>(sysconf(_SC_PAGESIZE)));
  if (const auto files = Entries("/proc/self/fd"))
    metrics.Gauge("process_open_fds", "Open files")
        .Value(static_cast<double>(*files - 1));  // not the listing's
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) == 0)
    metrics.Gauge("process_max_fds", "Most files that may be open")
        .Value(static_cast<double>(limit.rlim_cur));
  if (const auto threads = Entries("/proc/self/task"))
    metrics.Gauge("process_threads", "Threads").Value(static_cast<double>(*threads));
}

}  // namespace taclink::server
