#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// Link states whose buffers are used again once nobody holds them any more.
class StatePool {
 public:
  /// An old state with its old content, or a new one.
  std::unique_ptr<LinkState> Acquire() {
    const std::lock_guard lock(free_->mutex);
    if (free_->states.empty()) return std::make_unique<LinkState>();
    auto state = std::move(free_->states.back());
    free_->states.pop_back();
    return state;
  }

  /// Makes `state` immutable; it comes back to the pool with its last holder, even after the pool is gone.
  std::shared_ptr<const LinkState> Share(std::unique_ptr<LinkState> state) {
    return {state.release(), [free = free_](LinkState* returned) { free->Return(returned); }};
  }

 private:
  // More than this came back from a slow subscriber's queue and is not needed in the steady state.
  static constexpr size_t kKept = 8;

  struct FreeList {
    void Return(LinkState* state) {
      std::unique_ptr<LinkState> owned(state);
      const std::lock_guard lock(mutex);
      if (states.size() < kKept) states.push_back(std::move(owned));
    }
    std::mutex mutex;
    std::vector<std::unique_ptr<LinkState>> states;  // guarded by mutex
  };

  const std::shared_ptr<FreeList> free_ = std::make_shared<FreeList>();
};

}  // namespace taclink::server
