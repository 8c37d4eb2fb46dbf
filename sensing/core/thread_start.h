#pragma once

#include <atomic>
#include <exception>
#include <future>
#include <optional>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <type_traits>
#include <utility>

#include "sensing/core/result.h"

namespace taclink {

/// The error of a thread that could not be started: kResourceExhausted, with the limits that may be raised.
Error NoThread(const std::string& name, const std::string& reason);

/// Names the calling thread, for top -H and gdb; 15 characters are kept.
void NameThread(const std::string& name);

/// For tests: while it lives, no thread whose name begins with `prefix` can be started, as at the limit of
/// the system. One at a time.
class ThreadShortage {
 public:
  explicit ThreadShortage(std::string prefix = "");
  ~ThreadShortage();
  ThreadShortage(const ThreadShortage&) = delete;
  ThreadShortage& operator=(const ThreadShortage&) = delete;

  int refused() const { return refused_; }

  /// Throws std::system_error, as std::thread does, where such a shortage covers the name.
  static void Check(const std::string& name);

 private:
  const std::string prefix_;
  std::atomic<int> refused_ = 0;
};

namespace thread_start {
void CountDetached(int change);
[[noreturn]] void ThrowNoThread(const Error& error);
}  // namespace thread_start

/// Starts a thread of this name that runs `body`, which takes a std::stop_token or nothing. Where the system
/// has no thread to give (pids.max, TasksMax, ulimit -u), std::thread throws, which ends a server that does
/// not expect it: here it is an error. `body` is then destroyed, on the calling thread. Errors:
/// kResourceExhausted.
template <typename Body>
Result<std::jthread> StartThread(const std::string& name, Body body) {
  try {
    ThreadShortage::Check(name);
    return std::jthread([name, body = std::move(body)](const std::stop_token& stop) mutable {
      NameThread(name);
      if constexpr (std::is_invocable_v<Body&, const std::stop_token&>) {
        body(stop);
      } else {
        body();
      }
    });
  } catch (const std::system_error& e) {
    return NoThread(name, e.code().message());
  }
}

/// For a program's start, which can't go on without the thread: throws std::runtime_error with that error.
template <typename Body>
std::jthread MustStartThread(const std::string& name, Body body) {
  auto thread = StartThread(name, std::move(body));
  if (!thread) thread_start::ThrowNoThread(thread.error());
  return *std::move(thread);
}

/// Detached threads that have not ended. A process in which there are any must not destroy what is global,
/// which they may yet use: it leaves by std::_Exit.
int DetachedThreads();

/// As StartThread, for work that may hang and that nobody waits for. What `body` refers to must live as long
/// as the process; `body` is destroyed on its thread.
template <typename Body>
Result<void> StartDetachedThread(const std::string& name, Body body) {
  thread_start::CountDetached(1);
  auto thread = StartThread(name, [body = std::optional<Body>(std::move(body))]() mutable {
    (*body)();
    body.reset();
    thread_start::CountDetached(-1);
  });
  if (!thread) {
    thread_start::CountDetached(-1);
    return thread.error();
  }
  thread->detach();
  return {};
}

/// What `work` returns or throws, in a detached thread. Unlike that of std::async, this future's destructor
/// does not wait: a result that comes later is destroyed on that thread.
template <typename Work>
Result<std::future<std::invoke_result_t<Work&>>> RunDetached(const std::string& name, Work work) {
  using Value = std::invoke_result_t<Work&>;
  std::promise<Value> promise;
  std::future<Value> future = promise.get_future();
  const auto started =
      StartDetachedThread(name, [promise = std::move(promise), work = std::move(work)]() mutable {
        try {
          promise.set_value(work());
        } catch (...) {
          promise.set_exception(std::current_exception());
        }
      });
  if (!started) return started.error();
  return Result<std::future<Value>>(std::move(future));
}

}  // namespace taclink
