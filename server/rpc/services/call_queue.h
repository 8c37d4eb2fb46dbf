#pragma once

#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>

#include "sensing/core/result.h"
#include "server/security/shares.h"

namespace taclink::server {

/// Calls of one kind, which one thread answers one after the other. It bounds how many wait, of all and of
/// each party: who asks too often makes others wait for no more than its share. Any thread.
class CallQueue {
 public:
  static constexpr size_t kMostWaiting = 256, kMostWaitingPerParty = 16;

  /// `things`: what waits, for refusals: "waiting calls that read logs".
  explicit CallQueue(const char* things)
      : waiting_({.all = kMostWaiting, .per_party = kMostWaitingPerParty},
                 {.things = things, .all_setting = "", .party_setting = "", .remedy = "wait for an answer"}) {
  }

  /// `work` is done after what waits. Errors: kResourceExhausted (too many wait); then it is not.
  Result<void> Post(const Party& party, std::function<void()> work) {
    {
      const std::lock_guard lock(mutex_);
      if (const auto taken = waiting_.Take(party); !taken) return taken;
    }
    boost::asio::post(*thread_, [this, party, work = std::move(work)] {
      {
        // Before the call is answered: its client may ask again at once.
        const std::lock_guard lock(mutex_);
        waiting_.Give(party);
      }
      work();
    });
    return {};
  }

  /// Does what waits first. Only once no call can come any more.
  void Join() { thread_->join(); }

  /// Its thread, for work that is bounded elsewhere.
  const std::shared_ptr<boost::asio::thread_pool>& thread() const { return thread_; }

 private:
  std::mutex mutex_;
  Shares waiting_;  // guarded by mutex_
  const std::shared_ptr<boost::asio::thread_pool> thread_ = std::make_shared<boost::asio::thread_pool>(1);
};

}  // namespace taclink::server
