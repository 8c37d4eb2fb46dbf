#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "sensing/core/result.h"

namespace taclink::server {

class ReplayStream;

/// The Replay calls that are open, by ids that nobody can guess. Any thread.
class ReplayDesk {
 public:
  /// Returns the id. Errors: kUnavailable (the system gives no random numbers).
  Result<std::string> Enter(std::weak_ptr<ReplayStream> stream);
  void Leave(const std::string& id);
  /// Errors: kNotFound.
  Result<std::shared_ptr<ReplayStream>> Find(const std::string& id) const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, std::weak_ptr<ReplayStream>> streams_;  // guarded by mutex_
};

}  // namespace taclink::server
