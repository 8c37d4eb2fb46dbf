#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sensing/core/clock.h"
#include "sensing/core/result.h"
#include "server/arm/arm_poses.h"

namespace taclink::server {

/// What one client says of the joints at one instant.
struct JointMessage {
  std::vector<std::string> names;  ///< none: as before
  std::vector<double> positions;   ///< rad or m, by name
  std::vector<double> velocities;  ///< rad/s or m/s, by name; or none
  int64_t utc_ns = 0;              ///< 0: monotonic_ns is given
  int64_t monotonic_ns = 0;        ///< of this machine
};

struct JointCounts {
  uint64_t accepted = 0;
  uint64_t refused = 0;            ///< right, but of no use
  std::string first_refusal = {};  ///< why; empty: none
};

/// Takes one client's joint states, message after message, into the arm's. One thread.
class JointStateIntake {
 public:
  JointStateIntake(ArmPoses& poses, const Clock& clock) : poses_(poses), clock_(clock) {}

  /// Errors: kFailedPrecondition (no URDF), kInvalidArgument (which message and what is wrong with it);
  /// then nothing of the message was taken.
  Result<void> Take(const JointMessage& message);
  /// What is wrong with the message that would be next, with its place in the call.
  Error AtNextMessage(const Error& error) const;
  const JointCounts& counts() const { return counts_; }

 private:
  Result<void> Check(const JointMessage& message);
  Result<void> SetNames(const std::vector<std::string>& names);
  Result<int64_t> TimeOf(const JointMessage& message) const;
  void Refuse(std::string why);

  // Constant after construction.
  ArmPoses& poses_;
  const Clock& clock_;

  // Used by one thread.
  bool named_ = false;
  size_t names_ = 0;            // in the last message with names
  std::vector<size_t> places_;  // in the messages, of the joints that move by themselves
  std::vector<size_t> joints_;  // of the kinematics, by place
  int64_t last_ns_ = 0;         // monotonic
  JointCounts counts_;
  std::vector<double> positions_, velocities_;  // by places_
};

}  // namespace taclink::server
