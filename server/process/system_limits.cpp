#include "server/process/system_limits.h"

#include <sys/resource.h>

#include <boost/system/system_error.hpp>
#include <cerrno>
#include <fstream>
#include <new>
#include <system_error>

namespace taclink::server {
namespace {

void AddValue(std::string& list, const std::string& name, const std::string& value) {
  if (!value.empty()) list += (list.empty() ? "" : ", ") + name + " " + value;
}

std::string UserLimit(__rlimit_resource resource) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return {};
  return limit.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(limit.rlim_cur);
}

std::string FirstWord(const std::string& path) {
  std::string word;
  std::ifstream(path) >> word;
  return word;
}

// Of version 2; in a container the group of this process may be the root that it sees. Empty: not to be read.
std::string GroupLimit(const std::string& file) {
  constexpr const char* kRoot = "/sys/fs/cgroup";
  std::string group;
  std::ifstream in("/proc/self/cgroup");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with("0::")) group = line.substr(3);
  const std::string own = FirstWord(kRoot + group + "/" + file);
  return own.empty() ? FirstWord(std::string(kRoot) + "/" + file) : own;
}

std::string Threads() {
  std::ifstream in("/proc/self/status");
  for (std::string word; in >> word;)
    if (word == "Threads:" && in >> word) return word;
  return {};
}

std::string InBrackets(const std::string& values) {
  return values.empty() ? values : " (" + values + ")";
}

std::string NoThread() {
  std::string values;
  AddValue(values, "threads of this process:", Threads());
  AddValue(values, "pids.max", GroupLimit("pids.max"));
  AddValue(values, "ulimit -u", UserLimit(RLIMIT_NPROC));
  return "no thread can be started" + InBrackets(values) +
         ": raise TasksMax of the systemd unit, pids.max of the control group or ulimit -u (LimitNPROC), "
         "whichever is lowest";
}

std::string NoMemory() {
  std::string values;
  AddValue(values, "memory.max", GroupLimit("memory.max"));
  AddValue(values, "ulimit -v", UserLimit(RLIMIT_AS));
  return "out of memory" + InBrackets(values) +
         ": raise MemoryMax of the systemd unit, memory.max of the control group or ulimit -v (LimitAS), or "
         "configure fewer links and streams";
}

// Empty: another error.
std::string LimitOf(int error) {
  switch (error) {
    case EAGAIN:
      return NoThread();
    case EMFILE:
      return "this process has no file descriptor left" +
             InBrackets("ulimit -n " + UserLimit(RLIMIT_NOFILE)) +
             ": raise LimitNOFILE of the systemd unit or ulimit -n, or end some clients";
    case ENFILE:
      return "this machine has no file descriptor left" +
             InBrackets("fs.file-max " + FirstWord("/proc/sys/fs/file-max")) +
             ": raise it with sysctl, or end the programs that hold many files";
    case ENOMEM:
      return NoMemory();
    default:
      return {};
  }
}

// 0: no error of the system.
int SystemErrorOf(const std::exception& error) {
  if (const auto* standard = dynamic_cast<const std::system_error*>(&error)) {
    const std::error_category& category = standard->code().category();
    const bool system = category == std::generic_category() || category == std::system_category();
    return system ? standard->code().value() : 0;
  }
  if (const auto* of_boost = dynamic_cast<const boost::system::system_error*>(&error)) {
    const auto& category = of_boost->code().category();
    const bool system =
        category == boost::system::generic_category() || category == boost::system::system_category();
    return system ? of_boost->code().value() : 0;
  }
  return 0;
}

}  // namespace

std::string DescribeLimit(const std::exception& error) {
  const bool no_memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
  try {
    const std::string limit = no_memory ? NoMemory() : LimitOf(SystemErrorOf(error));
    return limit.empty() ? error.what() : limit + " (" + error.what() + ")";
  } catch (const std::bad_alloc&) {
    return "out of memory";  // so short that it needs none
  }
}

}  // namespace taclink::server
