#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace taclink::server {

/// One thread for work that is asked for before it is needed, in the order in which it comes. Of no lower
/// priority than the links' workers: on a busy machine it would hardly run, and they would wait for it. All
/// jobs that were posted are done before it ends.
class BackgroundThread {
 public:
  BackgroundThread();
  ~BackgroundThread();
  BackgroundThread(const BackgroundThread&) = delete;
  BackgroundThread& operator=(const BackgroundThread&) = delete;

  void Post(std::function<void()> job);

 private:
  void Run();

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::deque<std::function<void()>> jobs_;
  bool is_ending_ = false;

  std::jthread thread_;
};

}  // namespace taclink::server
