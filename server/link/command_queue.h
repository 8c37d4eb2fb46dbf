#pragma once

#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include "sensing/core/result.h"
#include "server/process/system_limits.h"

namespace taclink::server {

/// Commands that any thread posts and that one worker thread runs between two frames.
template <typename Target>
class CommandQueue {
 public:
  using Run = std::function<Result<void>(Target&)>;
  /// Called exactly once per accepted command, on the worker's thread or on the one that calls Close.
  using Done = std::function<void(const Result<void>&)>;

  /// Any thread. Errors: kUnavailable (closed), kResourceExhausted (too many commands wait); then `done` is
  /// not called.
  Result<void> Post(Run run, Done done) {
    const std::lock_guard lock(mutex_);
    if (closed_) return Error{ErrorCode::kUnavailable, "the link's worker has ended; try again when it runs"};
    if (jobs_.size() >= kCapacity)
      return Error{ErrorCode::kResourceExhausted, "too many commands wait for this link; try again"};
    jobs_.push_back({std::move(run), std::move(done)});
    return {};
  }

  /// On the worker's thread: runs the commands that wait now; what a command throws is its result. A command
  /// that is running stays in the queue, so that Close can answer for it while it hangs.
  void RunAll(Target& target) {
    for (size_t left = size(); left > 0; --left) {
      Run run;
      {
        const std::lock_guard lock(mutex_);
        if (jobs_.empty()) return;
        run = jobs_.front().run;
      }
      const Result<void> result = Guarded(run, target);
      Done done;
      {
        const std::lock_guard lock(mutex_);
        if (jobs_.empty()) return;  // closed in the meantime, and answered by Close
        done = std::move(jobs_.front().done);
        jobs_.pop_front();
      }
      done(result);
    }
  }

  /// Any thread: answers all commands with `why` and accepts no further ones.
  void Close(const Error& why) {
    std::deque<Job> jobs;
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      jobs.swap(jobs_);
    }
    for (const Job& job : jobs) job.done(why);
  }

 private:
  static constexpr size_t kCapacity = 16;

  struct Job {
    Run run;
    Done done;
  };

  size_t size() const {
    const std::lock_guard lock(mutex_);
    return jobs_.size();
  }
  static Result<void> Guarded(const Run& run, Target& target) {
    try {
      return run(target);
    } catch (const std::exception& e) {
      return Error{ErrorCode::kInternal, std::string("the command failed: ") + DescribeLimit(e)};
    }
  }

  mutable std::mutex mutex_;
  std::deque<Job> jobs_;  // guarded by mutex_; the first may be running
  bool closed_ = false;   // guarded by mutex_
};

}  // namespace taclink::server
