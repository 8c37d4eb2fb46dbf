#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "sensing/core/result.h"

namespace taclink::server {

/// The calls of one kind that are under way, so that the server can end them; holds none of them. `Call` has
/// `End(const Error&)`, which does nothing to a call that has ended.
template <typename Call>
class OpenCalls {
 public:
  /// Before anything can end the call. Errors: kUnavailable (closed).
  Result<void> Add(const std::shared_ptr<Call>& call) {
    const std::lock_guard lock(mutex_);
    if (!closed_.empty()) return Error{ErrorCode::kUnavailable, closed_};
    std::erase_if(calls_, [](const auto& old) { return old.expired(); });
    calls_.push_back(call);
    return {};
  }
  /// Ends all with `reason` and takes no more.
  void Close(const std::string& reason) {
    std::vector<std::weak_ptr<Call>> calls;
    {
      const std::lock_guard lock(mutex_);
      closed_ = reason;
      calls = std::exchange(calls_, {});
    }
    for (const auto& weak : calls) {
      if (const auto call = weak.lock()) call->End({ErrorCode::kUnavailable, reason});
    }
  }

 private:
  std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<std::weak_ptr<Call>> calls_;  // those that have ended are forgotten with the next one
  std::string closed_;                      // why no more are taken; empty: they are
};

}  // namespace taclink::server
