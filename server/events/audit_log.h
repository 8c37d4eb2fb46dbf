#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "server/events/event.h"

namespace taclink::server {

/// What was done to the links, as lines of JSON in a file of bounded size. A file that can't be written is
/// reported in the log, and tried again with the next line; nobody is stopped by it. One thread.
class AuditLog {
 public:
  /// `file` empty: nothing is written.
  AuditLog(std::string file, size_t max_bytes);

  /// Tares, calibrations, baselines, drift, thresholds and recordings are written, other kinds are not.
  void Write(const Event& event, const std::string& link);

  uint64_t failures() const { return failures_; }

 private:
  bool Append(const std::string& line);

  const std::string file_;
  const size_t max_bytes_;
  uint64_t failures_ = 0;
  bool failing_ = false;  // and said so
};

/// One line without its end; empty: the kind is not audited.
std::string AuditLine(const Event& event, const std::string& link);

}  // namespace taclink::server
