#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// Large objects whose buffers are used again once nobody holds them any more.
template <typename T>
class SharedPool {
 public:
  /// An old one with its old content, or a new one.
  std::unique_ptr<T> Acquire() {
    const std::lock_guard lock(free_->mutex);
    if (free_->objects.empty()) return std::make_unique<T>();
    auto object = std::move(free_->objects.back());
    free_->objects.pop_back();
    return object;
  }

  /// Makes `object` immutable; it comes back to the pool with its last holder, even after the pool is gone.
  std::shared_ptr<const T> Share(std::unique_ptr<T> object) {
    return {object.release(), [free = free_](T* returned) { free->Return(returned); }};
  }

 private:
  // More than this came back from a slow subscriber's queue and is not needed in the steady state.
  static constexpr size_t kKept = 8;

  struct FreeList {
    void Return(T* object) {
      std::unique_ptr<T> owned(object);
      const std::lock_guard lock(mutex);
      if (objects.size() < kKept) objects.push_back(std::move(owned));
    }
    std::mutex mutex;
    std::vector<std::unique_ptr<T>> objects;  // guarded by mutex
  };

  const std::shared_ptr<FreeList> free_ = std::make_shared<FreeList>();
};
using StatePool = SharedPool<LinkState>;

}  // namespace taclink::server
