#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace taclink::command {

/// Threads that share the work of several links: that of one link is done piece by piece in its order, that
/// of different links at the same time. What waits is dropped at the end.
class LinkCrew {
 public:
  LinkCrew(size_t links, size_t threads);
  ~LinkCrew();
  LinkCrew(const LinkCrew&) = delete;
  LinkCrew& operator=(const LinkCrew&) = delete;

  /// What `work` returns or throws; broken_promise: it was dropped.
  template <typename Work>
  auto Post(size_t link, Work work) {
    auto task = std::make_shared<std::packaged_task<std::invoke_result_t<Work>()>>(std::move(work));
    auto end = task->get_future();
    Add(link, [task = std::move(task)] { (*task)(); });
    return end;
  }

 private:
  struct Line {
    std::deque<std::function<void()>> waiting;
    bool busy = false;  // in ready_, or one of it is being done
  };

  void Add(size_t link, std::function<void()> work);
  void Run(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any news_;
  // Guarded by mutex_.
  std::vector<Line> lines_;   // by link
  std::deque<size_t> ready_;  // links with work that nobody does

  std::vector<std::jthread> threads_;
};

}  // namespace taclink::command
