#include "client/cpp/taclink/follow.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <random>
#include <thread>
#include <utility>

#include "sensing/core/thread_start.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kWait{60'000};  // of one read; then it is waited on again
const Error kStopped{ErrorCode::kEndOfData, "stopped"};

bool IsForGood(ErrorCode code) {
  return code == ErrorCode::kInvalidArgument || code == ErrorCode::kNotFound ||
         code == ErrorCode::kUnauthenticated || code == ErrorCode::kPermissionDenied ||
         code == ErrorCode::kUnsupported;
}

}  // namespace

// One thread that connects, reads, and begins again.
class Subscription::Worker {
 public:
  /// `read` opens the stream, calls ReadAll and returns why it ended.
  using Read = std::function<Error(Worker&, Client&)>;
  Worker(FollowOptions options, Read read) : options_(std::move(options)), read_(std::move(read)) {
    auto thread = StartThread("taclink-follow", [this] { Run(); });
    if (thread) {
      thread_ = *std::move(thread);
      return;
    }
    ended_ = true;
    if (options_.on_refused) options_.on_refused(thread.error());
  }

  void Stop() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
      if (cancel_) cancel_();
    }
    wake_.notify_all();
    if (running_here != this && thread_.joinable()) thread_.join();
  }

  bool ended() const { return ended_; }

  template <typename Reader, typename Handle>
  Error ReadAll(Reader& reader, const Handle& handle) {
    if (!Begin([&reader] { reader.Cancel(); })) return kStopped;
    if (options_.on_connected) options_.on_connected();
    while (!stopping()) {
      const auto message = reader.Next(kWait);
      if (!message && message.error().code == ErrorCode::kTimeout) continue;
      if (!message) return End(), message.error();
      attempt_ = 0;
      if (handle) handle(*message);
    }
    return End(), kStopped;
  }

 private:
  bool Begin(std::function<void()> cancel) {
    const std::lock_guard lock(mutex_);
    if (!stopping_) cancel_ = std::move(cancel);
    return !stopping_;
  }

  void End() {
    const std::lock_guard lock(mutex_);
    cancel_ = {};
  }

  bool stopping() {
    const std::lock_guard lock(mutex_);
    return stopping_;
  }

  milliseconds NextDelay() {
    const double doubled = static_cast<double>(options_.first_delay.count()) * std::exp2(attempt_++);
    const double delay = std::min(doubled, static_cast<double>(options_.longest_delay.count()));
    return milliseconds(
        static_cast<int64_t>(delay * std::uniform_real_distribution<double>(0.8, 1.2)(random_)));
  }

  void Run() {
    running_here = this;
    while (!stopping()) {
      auto client = Client::Connect(options_.address, options_.credentials);
      const Error error = client ? read_(*this, *client) : client.error();
      if (stopping()) break;
      if (IsForGood(error.code)) {
        if (options_.on_refused) options_.on_refused(error);
        break;
      }
      const milliseconds delay = NextDelay();
      if (options_.on_disconnected) options_.on_disconnected({error, attempt_, delay});
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, delay, [this] { return stopping_; });
    }
    ended_ = true;
  }

  static thread_local const Worker* running_here;

  const FollowOptions options_;
  const Read read_;
  std::minstd_rand random_{std::random_device{}()};
  int attempt_ = 0;
  std::atomic<bool> ended_ = false;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;         // guarded by mutex_
  std::function<void()> cancel_;  // guarded by mutex_; of the stream that is being read

  std::jthread thread_;  // last: it uses all else
};

thread_local const Subscription::Worker* Subscription::Worker::running_here = nullptr;

Subscription::Subscription(std::unique_ptr<Worker> worker) : worker_(std::move(worker)) {}
Subscription::~Subscription() {
  worker_->Stop();
}

void Subscription::Stop() {
  worker_->Stop();
}
bool Subscription::ended() const {
  return worker_->ended();
}

std::unique_ptr<Subscription> FollowFrames(FollowOptions options, v1::StreamFramesRequest request,
                                           std::function<void(const v1::LinkFrame&)> on_frame) {
  auto read = [request = std::move(request), on_frame = std::move(on_frame), max_age = options.max_age](
                  Subscription::Worker& worker, Client& client) {
    const auto reader = client.StreamFrames(request);
    if (!reader) return reader.error();
    (*reader)->SetMaxAge(max_age);
    return worker.ReadAll(**reader, on_frame);
  };
  return std::make_unique<Subscription>(
      std::make_unique<Subscription::Worker>(std::move(options), std::move(read)));
}

std::unique_ptr<Subscription> FollowContacts(
    FollowOptions options, double max_rate_hz,
    std::function<void(const v1::StreamContactsResponse&)> on_contacts) {
  auto read = [max_rate_hz, on_contacts = std::move(on_contacts)](Subscription::Worker& worker,
                                                                  Client& client) {
    const auto reader = client.StreamContacts(max_rate_hz);
    return reader ? worker.ReadAll(**reader, on_contacts) : reader.error();
  };
  return std::make_unique<Subscription>(
      std::make_unique<Subscription::Worker>(std::move(options), std::move(read)));
}

std::unique_ptr<Subscription> FollowEvents(FollowOptions options, v1::StreamEventsRequest request,
                                           std::function<void(const v1::Event&)> on_event) {
  auto read = [request = std::move(request), on_event = std::move(on_event)](Subscription::Worker& worker,
                                                                             Client& client) mutable {
    const auto reader = client.StreamEvents(request);
    if (!reader) return reader.error();
    const Error ended = worker.ReadAll(**reader, on_event);
    request.set_run_id((*reader)->status().run_id());
    request.set_after_sequence((*reader)->status().position());
    return ended;
  };
  return std::make_unique<Subscription>(
      std::make_unique<Subscription::Worker>(std::move(options), std::move(read)));
}

}  // namespace taclink::client
