#pragma once

#include <functional>
#include <memory>
#include <string>

#include "sensing/core/result.h"
#include "server/config/options.h"
#include "server/publish/outbox.h"

namespace taclink::server {

/// Whether files and URLs are usable; connects to nothing. Errors: kNotFound, kInvalidArgument.
Result<void> CheckPublish(const PublishConfig& config);

/// A connection to JetStream that comes back by itself. Callbacks come from NATS' threads.
class NatsConnection {
 public:
  struct Callbacks {
    std::function<void()> changed;  ///< connected() may be another now
    /// To each message sent: empty: it is stored; else why it is not.
    std::function<void(const std::string& id, const std::string& error)> answered;
  };

  /// Returns without a server being there. Errors: kNotFound, kInvalidArgument (files, URL).
  static Result<std::unique_ptr<NatsConnection>> Open(const PublishConfig& config, const std::string& name,
                                                      Callbacks callbacks);
  ~NatsConnection();  ///< no callback comes after it
  NatsConnection(const NatsConnection&) = delete;
  NatsConnection& operator=(const NatsConnection&) = delete;

  bool connected() const;
  /// Given up, as after a refusal of this user; Reopen tries again.
  bool closed() const;
  /// Reads the files again. Errors: as Open.
  Result<void> Reopen();
  /// Why it is not connected, as far as it is known.
  std::string trouble() const;
  /// Makes the stream unless it is there. Errors: kUnavailable (no answer), kFailedPrecondition (no
  /// JetStream, no permission, another stream has the subjects).
  Result<void> PrepareStream();
  /// An answer follows. Errors: kUnavailable.
  Result<void> Send(const OutMessage& message);

 private:
  friend Result<void> CheckPublish(const PublishConfig& config);
  struct State;
  explicit NatsConnection(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

}  // namespace taclink::server
