#pragma once

#include <cstdint>
#include <string>

namespace taclink::server {

/// Tells systemd how the service does, as sd_notify(3) would. Does nothing where nobody listens.
class SystemdNotifier {
 public:
  /// As the environment says: NOTIFY_SOCKET, WATCHDOG_USEC, WATCHDOG_PID.
  static SystemdNotifier FromEnvironment();
  SystemdNotifier(std::string socket, int64_t watchdog_ns)
      : socket_(std::move(socket)), watchdog_ns_(watchdog_ns) {}

  /// Lines of KEY=VALUE. False: nobody listens, or not all could be told. Any thread.
  bool Send(const std::string& lines) const;

  /// systemd ends a service that says "WATCHDOG=1" less often than this; 0: it does not look.
  int64_t watchdog_ns() const { return watchdog_ns_; }

 private:
  // Constant after construction.
  std::string socket_;  // path, or @name of an abstract one; empty: none
  int64_t watchdog_ns_;
};

}  // namespace taclink::server
