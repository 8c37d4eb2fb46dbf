#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "taclink/arm_contacts.h"
#include "taclink/client.h"
#include "taclink/events.h"

/// Streams that are handed to callbacks and begin again when the server goes away and comes back.
namespace taclink::client {

/// Why nothing comes now, and when it is tried again.
struct Disconnection {
  Error error;
  int attempt = 0;                     ///< since something came last, from 1
  std::chrono::milliseconds delay{0};  ///< until the next
};

/// Callbacks run on the subscription's own thread, one at a time; they may be empty and must not throw.
struct FollowOptions {
  std::string address = "127.0.0.1:50051";
  Credentials credentials = {};
  /// Each attempt waits twice as long as the one before, within these, a fifth more or less at random so that
  /// many clients do not come back at once.
  std::chrono::milliseconds first_delay{250}, longest_delay{2000};
  std::function<void()> on_connected = {};  ///< the server has accepted, for the first time or again
  std::function<void(const Disconnection&)> on_disconnected = {};
  /// The server refuses for good (kInvalidArgument, kNotFound, kUnauthenticated, kPermissionDenied,
  /// kUnsupported, or files that cannot be read): the subscription has ended. Also, on the caller's thread
  /// before Follow... returns, that the system has no thread for it (kResourceExhausted).
  std::function<void(const Error&)> on_refused = {};
  /// Of FollowFrames, as FrameReader::SetMaxAge; 0: any age.
  std::chrono::nanoseconds max_age{0};
};

/// Ends with it. Not to be destroyed or moved from by its own callbacks; they may call Stop.
class Subscription {
 public:
  ~Subscription();
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

  /// No callback runs after it returns, but the one that calls it. May take as long as Client::Connect while
  /// there is no server.
  void Stop();
  /// By Stop or because the server refused.
  bool ended() const;

  class Worker;  // internal to the library
  explicit Subscription(std::unique_ptr<Worker> worker);

 private:
  std::unique_ptr<Worker> worker_;
};

/// What was published while there was no connection is missing: LinkFrame.sequence shows the gap.
std::unique_ptr<Subscription> FollowFrames(FollowOptions options, v1::StreamFramesRequest request,
                                           std::function<void(const v1::LinkFrame&)> on_frame);

/// `max_rate_hz` 0: whenever a link publishes.
std::unique_ptr<Subscription> FollowContacts(
    FollowOptions options, double max_rate_hz,
    std::function<void(const v1::StreamContactsResponse&)> on_contacts);

/// Resumes after the newest event: none is missed as long as the server still has it in its history
/// and was not restarted.
std::unique_ptr<Subscription> FollowEvents(FollowOptions options, v1::StreamEventsRequest request,
                                           std::function<void(const v1::Event&)> on_event);

}  // namespace taclink::client
