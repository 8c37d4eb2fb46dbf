#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/arm/arm.h"
#include "server/config/options.h"
#include "server/publish/nats_connection.h"
#include "server/publish/outbox.h"

namespace taclink::server {

struct PublishStatus {
  bool connected = false;
  std::string trouble;  ///< empty: none
  OutboxCounts outbox;
};

/// Sends what the arm's links publish to JetStream: a subscriber of the hub and of the events with a thread
/// of its own. Subjects: taclink.SITE.ARM.LINK.KIND, kind being frame (LinkFrame), contacts (LinkFrame at the
/// level CONTACTS) or event (Event; of the whole arm: link '_'). While there is no server all waits in
/// memory.
class Publisher {
 public:
  /// The arm must outlive it. Errors: as NatsConnection::Open.
  static Result<std::unique_ptr<Publisher>> Start(Arm& arm, const PublishConfig& config);
  ~Publisher();

  /// Gives what waits so long to be acknowledged. May be called twice.
  void Close(std::chrono::milliseconds limit);
  PublishStatus Status() const;

 private:
  struct Post;
  Publisher(Arm& arm, const PublishConfig& config);

  void Subscribe();
  void Run(const std::stop_token& stop);
  void Round();
  void TakeFrames();
  void TakeContacts();
  void TakeEvents();
  void Push(const std::string& link, const char* kind, std::shared_ptr<const std::string> bytes,
            std::string tail, bool frame);
  void TakeAnswers();
  bool MaySend();
  void Send();
  void SetTrouble(const std::string& trouble);

  // Constant after construction.
  Arm& arm_;
  const PublishConfig config_;
  const std::string prefix_;  // of subjects
  const std::vector<std::string> links_;
  const std::shared_ptr<Post> post_;

  // Used by the thread.
  Outbox outbox_;
  std::unique_ptr<NatsConnection> connection_;
  std::unique_ptr<Subscription> frames_, contacts_;
  std::unique_ptr<EventCursor> events_;
  bool was_connected_ = false, prepared_ = false;
  int64_t wait_until_ns_ = 0;  // monotonic: after a refusal
  std::string trouble_;
  uint64_t messages_ = 0;  // pushed until now

  std::atomic<uint64_t> rounds_ = 0;
  mutable std::mutex mutex_;
  PublishStatus status_;  // guarded by mutex_

  std::jthread thread_;
};

}  // namespace taclink::server
