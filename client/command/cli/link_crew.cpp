#include "client/command/cli/link_crew.h"

#include "sensing/core/thread_start.h"

namespace taclink::command {

LinkCrew::LinkCrew(size_t links, size_t threads) : lines_(links) {
  for (size_t i = 0; i < threads; ++i)
    threads_.push_back(MustStartThread("log-links", [this](const std::stop_token& stop) { Run(stop); }));
}

LinkCrew::~LinkCrew() {
  for (std::jthread& thread : threads_) thread.request_stop();
  threads_.clear();  // joins
}

void LinkCrew::Add(size_t link, std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  Line& line = lines_[link];
  line.waiting.push_back(std::move(work));
  if (line.busy) return;
  line.busy = true;
  ready_.push_back(link);
  news_.notify_one();
}

void LinkCrew::Run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (news_.wait(lock, stop, [this] { return !ready_.empty(); }) && !stop.stop_requested()) {
    const size_t link = ready_.front();
    ready_.pop_front();
    auto work = std::move(lines_[link].waiting.front());
    lines_[link].waiting.pop_front();
    lock.unlock();
    work();
    work = nullptr;
    lock.lock();
    lines_[link].busy = !lines_[link].waiting.empty();
    if (!lines_[link].busy) continue;
    ready_.push_back(link);
    news_.notify_one();
  }
}

}  // namespace taclink::command
