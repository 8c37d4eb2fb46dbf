#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "taclink/client.h"
#include "taclink/v1/acceptance.pb.h"

namespace taclink::client {

/// The acceptances of a server's links: trials with references from outside, and their report; see
/// acceptance.proto. A view of the client's connection; it keeps the connection open.
class Acceptances {
 public:
  /// Starts one, or resumes the one under way. Errors: kNotFound (no such link), kInvalidArgument (the plan),
  /// kFailedPrecondition (another plan is under way; the server has no folder for them).
  Result<v1::Acceptance> Start(const v1::StartAcceptanceRequest& request);
  /// Returns when the link was measured for the phase's duration. Errors: as Start; kNotFound (no such
  /// trial), kUnavailable (no frames), kResourceExhausted (the link is being measured).
  Result<v1::Acceptance> Measure(const v1::MeasureTrialRequest& request, double expected_s = 1);
  Result<v1::Acceptance> Skip(const v1::SkipTrialRequest& request);
  Result<v1::Acceptance> Finish(const v1::FinishAcceptanceRequest& request);
  /// Errors: kNotFound, kFailedPrecondition (there is none).
  Result<v1::Acceptance> Get(const v1::GetAcceptanceRequest& request);

 private:
  friend class Client;
  struct Connection;
  explicit Acceptances(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}

  std::shared_ptr<Connection> connection_;
};

}  // namespace taclink::client
