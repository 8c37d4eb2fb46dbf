#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "mcap/reader.h"
#include "server/recording/log_folder.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::server {

/// What the logs of a folder hold. Remembers those that do not change. Any thread; reads files.
class LogCatalog {
 public:
  explicit LogCatalog(LogFolder folder) : folder_(std::move(folder)) {}

  std::vector<v1::Log> List();
  /// Errors: kNotFound, kInvalidArgument (no name of a log, or damaged beyond reading).
  Result<v1::DescribeLogResponse> Describe(const std::string& name);
  /// Likewise. `entry` may be null.
  Result<std::unique_ptr<mcap::Reader>> Open(const std::string& name, LogFileEntry* entry = nullptr) const;

 private:
  struct Known {
    uint64_t bytes = 0;
    v1::Log log;
  };
  v1::Log Summarise(const LogFileEntry& entry) const;

  const LogFolder folder_;
  std::mutex mutex_;
  std::map<std::string, Known> known_;  // guarded by mutex_
};

}  // namespace taclink::server
