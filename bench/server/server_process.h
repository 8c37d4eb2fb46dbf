#pragma once

#include <sys/types.h>

#include <memory>
#include <string>

#include "sensing/core/result.h"

namespace taclink::command {

/// CPU time and memory of a process at one moment.
struct ProcessUsage {
  double cpu_s = 0;  ///< of all its threads since it began
  double resident_mb = 0;
};

/// Of this process and of all there are (without memory).
ProcessUsage OwnUsage();
ProcessUsage MachineUsage();

/// A taclinkd of its own on this machine; ends with this object, or with this process.
class ServerProcess {
 public:
  /// Returns once it listens on loopback. `program`: empty: the one beside this program. Errors: kUnavailable
  /// (it did not start; with its last words).
  static Result<std::unique_ptr<ServerProcess>> Start(const std::string& program, const std::string& config,
                                                      const std::string& log);
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  const std::string& address() const { return address_; }
  ProcessUsage Usage() const;

 private:
  explicit ServerProcess(pid_t pid) : pid_(pid) {}
  bool Running();

  pid_t pid_;
  std::string address_;
};

}  // namespace taclink::command
