#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

namespace taclink::server {

/// One place between two threads, where the newest value waits. Values are swapped, so that their buffers go
/// round between writer, place and reader and nothing is allocated.
template <typename T>
class Mailbox {
 public:
  /// Puts `value` in; afterwards it holds an old value whose buffers may be reused.
  void Put(T& value) {
    {
      const std::lock_guard lock(mutex_);
      std::swap(value, place_);
      full_ = true;
    }
    filled_.notify_one();
  }

  /// Waits until the place is empty. False: the last value was not taken in time.
  bool WaitUntilTaken(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    return taken_.wait_for(lock, timeout, [this] { return !full_; });
  }

  /// Waits for a value and swaps it with `value`. False: none came in time, `value` is untouched.
  bool Take(T& value, std::chrono::milliseconds timeout) {
    {
      std::unique_lock lock(mutex_);
      if (!filled_.wait_for(lock, timeout, [this] { return full_; })) return false;
      std::swap(value, place_);
      full_ = false;
    }
    taken_.notify_one();
    return true;
  }

 private:
  std::mutex mutex_;
  std::condition_variable filled_, taken_;
  // Guarded by mutex_.
  T place_{};
  bool full_ = false;
};

}  // namespace taclink::server
