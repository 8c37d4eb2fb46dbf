#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>

#include "mcap/file_calls.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// In which order the logs of a folder were begun. It is kept in the folder (file ".order", one name per
/// line, the newest last), over restarts and for all servers that record there. Neither names nor clocks tell
/// it: a machine without a clock battery begins in 1970, and a clock may be set back. Any thread.
class LogOrder {
 public:
  static constexpr const char* kFile = ".order";

  /// `calls` must outlive it.
  LogOrder(const std::string& folder, mcap::FileCalls& calls)
      : folder_(folder), path_(folder + "/" + kFile), calls_(calls) {}

  /// The log is the newest from now on, safe from a power cut. Errors: kUnavailable with the system's reason.
  Result<void> Append(const std::string& log) const;
  /// The rank of each log that was appended, rising. Logs that came here in another way have none.
  std::map<std::string, uint64_t> Ranks() const;
  /// Removes the names of logs that are not among `existing`, if they are many. It is called while no other
  /// server can append.
  void Compact(const std::function<std::set<std::string>()>& existing) const;

 private:
  const std::string folder_, path_;
  mcap::FileCalls& calls_;
};

}  // namespace taclink::server
