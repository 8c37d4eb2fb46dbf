#include "server/publish/publisher.h"

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/messages/event_message.h"
#include "server/process/system_limits.h"
#include "wire/frame_codec.h"

namespace taclink::server {
namespace {

constexpr std::chrono::milliseconds kPoll{50};  // what comes is sent in batches: waking for each costs more
constexpr size_t kQueuedFrames = 4096;
constexpr size_t kInFlight = 1024;
constexpr int64_t kPauseNs = 1'000'000'000, kReopenNs = 10 * kPauseNs;
constexpr double kMostContactsHz = 100;  // of each link

size_t Megabytes(double mb) {
  return static_cast<size_t>(mb * 1e6);
}

// Parts of subjects have no dots, blanks and wildcards.
std::string Token(std::string name) {
  for (char& c : name) {
    const bool good = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    if (!good) c = '_';
  }
  return name.empty() ? "_" : name;
}

std::vector<std::string> Tokens(const std::vector<std::string>& names) {
  std::vector<std::string> out;
  out.reserve(names.size());
  for (const std::string& name : names) out.push_back(Token(name));
  return out;
}

}  // namespace

// What other threads leave for the publisher's.
struct Publisher::Post {
  void Wake() {
    {
      const std::lock_guard lock(mutex);
      woken = true;
    }
    changed.notify_one();
  }
  void Answer(const std::string& id, const std::string& error) {
    const std::lock_guard lock(mutex);
    answers.emplace_back(id, error);
  }
  void Wait() {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, kPoll, [this] { return woken; });
    woken = false;
  }
  std::vector<std::pair<std::string, std::string>> TakeAnswers() {
    const std::lock_guard lock(mutex);
    return std::exchange(answers, {});
  }

  std::mutex mutex;
  std::condition_variable changed;
  bool woken = false;
  std::vector<std::pair<std::string, std::string>> answers;  // id, error
};

Publisher::Publisher(Arm& arm, const PublishConfig& config)
    : arm_(arm),
      config_(config),
      prefix_("taclink." + config.site + "." + Token(arm.name()) + "."),
      links_(Tokens(arm.link_names())),
      post_(std::make_shared<Post>()),
      outbox_(Megabytes(config.queue_mb)) {}

Result<std::unique_ptr<Publisher>> Publisher::Start(Arm& arm, const PublishConfig& config) {
  std::unique_ptr<Publisher> out(new Publisher(arm, config));
  const std::shared_ptr<Post> post = out->post_;
  auto connection = NatsConnection::Open(
      config, "taclinkd " + arm.name(),
      {.changed = [post] { post->Wake(); },
       .answered = [post](const std::string& id, const std::string& error) { post->Answer(id, error); }});
  if (!connection) return connection.error();
  out->connection_ = std::move(*connection);
  out->Subscribe();
  auto thread =
      StartThread("publisher", [self = out.get()](const std::stop_token& stop) { self->Run(stop); });
  if (!thread) return thread.error();
  out->thread_ = *std::move(thread);
  return out;
}

Publisher::~Publisher() {
  Close(std::chrono::milliseconds(0));
}

void Publisher::Subscribe() {
  const size_t bytes = Megabytes(config_.queue_mb);
  if (config_.frames_rate_hz > 0) {
    frames_ = arm_.hub().Subscribe({.delivery = Delivery::kEvery,
                                    .max_rate_hz = config_.frames_rate_hz,
                                    .queue_capacity = kQueuedFrames,
                                    .queue_bytes = bytes,
                                    .detail = config_.frames_detail},
                                   [] {});
  }
  contacts_ = arm_.hub().Subscribe({.delivery = Delivery::kEvery,
                                    .max_rate_hz = kMostContactsHz,
                                    .queue_capacity = kQueuedFrames,
                                    .queue_bytes = bytes,
                                    .detail = Detail::kContacts,
                                    .deadband = {.force_n = config_.contacts_deadband_n}},
                                   [] {});
  EventHistory& history = arm_.events().history();
  events_ = std::make_unique<EventCursor>(history, history.newest(), EventFilter{}, [] {});
}

void Publisher::Close(std::chrono::milliseconds limit) {
  const auto give_up = std::chrono::steady_clock::now() + limit;
  // One round may be under way, the next one takes all that was published until now.
  const uint64_t enough = rounds_ + 2;
  while (thread_.joinable() && std::chrono::steady_clock::now() < give_up) {
    const PublishStatus status = Status();
    const bool done = !status.connected || status.outbox.waiting + status.outbox.in_flight == 0;
    if (done && rounds_ >= enough) break;
    post_->Wake();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  thread_.request_stop();
  post_->Wake();
  if (!thread_.joinable()) return;
  thread_.join();
  connection_.reset();
  const OutboxCounts counts = outbox_.counts();
  const size_t left = counts.waiting + counts.in_flight;
  if (left > 0) SPDLOG_WARN("publish: {} messages were not acknowledged and are lost", left);
}

void Publisher::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    post_->Wait();
    try {
      Round();
    } catch (const std::exception& e) {
      SetTrouble(DescribeLimit(e));
    }
  }
}

void Publisher::Round() {
  if (frames_) TakeFrames();
  TakeContacts();
  TakeEvents();
  TakeAnswers();
  if (MaySend()) Send();
  // Also what fell out before this thread could take it.
  OutboxCounts counts = outbox_.counts();
  counts.frames_dropped += frames_ ? frames_->dropped() : 0;
  counts.others_dropped += contacts_->dropped() + events_->lost();
  {
    const std::lock_guard lock(mutex_);
    status_ = {.connected = was_connected_, .trouble = trouble_, .outbox = counts};
  }
  ++rounds_;
}

void Publisher::Push(const std::string& link, const char* kind, std::shared_ptr<const std::string> bytes,
                     std::string tail, bool frame) {
  // Not the frame's sequence: a link that is restarted begins again with 1, one without pictures stays.
  outbox_.Push({.subject = prefix_ + link + "." + kind,
                .id = arm_.events().history().run_id() + "." + std::to_string(++messages_),
                .bytes = std::move(bytes),
                .tail = std::move(tail),
                .frame = frame});
}

void Publisher::TakeFrames() {
  while (const auto publication = frames_->Take()) {
    Push(links_[publication->link()], "frame", publication->Encoded(config_.frames_detail), {}, true);
  }
}

void Publisher::TakeContacts() {
  bool unchanged = false;
  while (const auto publication = contacts_->Take(&unchanged)) {
    Push(links_[publication->link()], "contacts", publication->Encoded(Detail::kContacts),
         unchanged ? wire::UnchangedMark() : "", false);
  }
}

void Publisher::TakeEvents() {
  while (true) {
    const EventCursor::Step step = events_->Next();
    if (step.status) continue;
    if (!step.event) return;
    const Event& event = *step.event;
    v1::Event message;
    Fill(event, event.link ? arm_.links()[*event.link].name : std::string(), message);
    Push(event.link ? links_[*event.link] : "_", "event",
         std::make_shared<const std::string>(message.SerializeAsString()), {}, false);
  }
}

void Publisher::TakeAnswers() {
  std::string refusal;
  for (const auto& [id, error] : post_->TakeAnswers()) {
    if (error.empty()) {
      outbox_.Acknowledge(id);
    } else {
      outbox_.Return(id);
      refusal = error;
    }
  }
  if (refusal.empty()) return;
  wait_until_ns_ = arm_.clock().MonotonicNs() + kPauseNs;
  prepared_ = false;
  SetTrouble(refusal);
}

bool Publisher::MaySend() {
  const bool connected = connection_->connected();
  if (connected != std::exchange(was_connected_, connected)) {
    if (!connected) outbox_.ReturnAll();
    prepared_ = false;
    wait_until_ns_ = 0;
  }
  if (!connected) {
    const std::string why = connection_->trouble();
    SetTrouble("no NATS server at " + config_.url + (why.empty() ? "" : " (" + why + ")"));
    const int64_t now_ns = arm_.clock().MonotonicNs();
    if (connection_->closed() && now_ns >= wait_until_ns_) {
      wait_until_ns_ = now_ns + kReopenNs;
      if (const auto opened = connection_->Reopen(); !opened) SetTrouble(opened.error().message);
    }
    return false;
  }
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (now_ns < wait_until_ns_) return false;
  if (prepared_) return true;
  if (const auto good = connection_->PrepareStream(); !good) {
    wait_until_ns_ = now_ns + kPauseNs;
    SetTrouble(good.error().message);
    return false;
  }
  SetTrouble("");
  return prepared_ = true;
}

void Publisher::Send() {
  while (outbox_.in_flight() < kInFlight) {
    const OutMessage* const message = outbox_.Next();
    if (message == nullptr) return;
    if (const auto sent = connection_->Send(*message); !sent) {
      outbox_.Return(std::string(message->id));
      wait_until_ns_ = arm_.clock().MonotonicNs() + kPauseNs;
      return SetTrouble(sent.error().message);
    }
  }
}

void Publisher::SetTrouble(const std::string& trouble) {
  if (trouble_ == trouble) return;
  const OutboxCounts counts = outbox_.counts();
  if (trouble.empty()) {
    SPDLOG_INFO("publish: stream {} takes what comes; {} messages waited, {} frames gave way", config_.stream,
                counts.waiting, counts.frames_dropped);
  } else {
    SPDLOG_WARN("publish: {}; events and contacts wait, up to {} MB", trouble, config_.queue_mb);
  }
  trouble_ = trouble;
}

PublishStatus Publisher::Status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace taclink::server
