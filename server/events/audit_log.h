#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>

#include "sensing/core/result.h"
#include "server/events/event.h"

namespace taclink::server {

/// What was done to the links, as lines of JSON in a file of bounded size, in a folder that is made for it.
/// While the file can't be written, which the log says, the newest 1000 lines wait, and come with the next
/// that can be; the log says how many were too many. Nobody is stopped by it. One thread.
class AuditLog {
 public:
  /// `file` empty: nothing is written.
  AuditLog(std::string file, size_t max_bytes);

  /// Drift and every Operation are written, such as a tare, a threshold or a force model; others are not.
  void Write(const Event& event, const std::string& link);
  /// Something that was done to the server, and not by an event.
  void Write(const std::string& what, const Operation& operation, int64_t utc_ns);

  uint64_t lost() const { return lost_; }

 private:
  void WriteLine(std::string line);
  Result<void> Append(const std::string& line) const;

  const std::string file_;
  const size_t max_bytes_;
  std::deque<std::string> waiting_;  // oldest first
  uint64_t lost_ = 0;                // that were too many
  bool failing_ = false;             // and said so
};

/// One line without its end; empty: the kind is not audited.
std::string AuditLine(const Event& event, const std::string& link);

}  // namespace taclink::server
