#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "taclink/client.h"

namespace taclink::client {

/// How far a pose that depends on joint positions can be trusted.
enum class PoseValidity {
  kUnspecified,
  kFixed,         ///< no joint is involved
  kInterpolated,  ///< joint states before and after
  kExtrapolated,  ///< the newest joint states are a little older
  kStale,         ///< they are too old: taken as standing still since
  kUnknown,       ///< a joint never had a state
};
const char* Name(PoseValidity validity);

/// A contact in the arm's base frame.
struct ArmContact {
  uint64_t id = 0;  ///< lasts while the contact does; unique over the arm
  std::string link;
  int link_index = 0;
  Vector3 center_m{};
  Vector3 normal{};     ///< unit, out of the skin
  Vector3 force_n{};    ///< what the world exerts on the skin
  Vector3 moment_nm{};  ///< of that about the base frame's origin
  std::optional<Covariance3> force_covariance_n2;
  std::optional<Covariance3> center_covariance_m2;
  double normal_force_n = 0;  ///< pressing in is positive
  double area_m2 = 0;
  bool is_ring_contact = false;  ///< as Contact
  int64_t exposure_utc_ns = 0;
  PoseValidity validity = PoseValidity::kUnspecified;
};

/// What the contacts cause on one joint.
struct JointTorque {
  std::string joint;
  double torque_nm = 0;            ///< prismatic joints: N
  std::optional<double> sigma_nm;  ///< standard deviation; none: not known
};

/// How one link stands at its newest frame.
struct LinkContacts {
  std::string link;
  LinkStatus status = LinkStatus::kUnknown;
  /// Nothing is measured, or what was found can't be trusted: it may be pressed, and the total and the joint
  /// torques are without it.
  bool forces_unknown = false;
  uint64_t sequence = 0;
  Pose base_from_link;
  PoseValidity validity = PoseValidity::kUnspecified;
  double joint_state_distance_s = 0;  ///< -1: there is no joint state
};

/// All contacts of the arm.
struct ArmContacts {
  std::vector<LinkContacts> links;
  std::vector<ArmContact> contacts;
  std::optional<Vector3> total_force_n;    ///< of links whose forces are known; none: those of no link are
  std::optional<Vector3> total_moment_nm;  ///< likewise, about the base frame's origin
  std::vector<JointTorque> joints;         ///< likewise; empty: not known, or there are none
  PoseValidity validity = PoseValidity::kUnspecified;  ///< the worst of the links with contacts
  uint64_t sequence = 0;                               ///< of this stream's messages
  int64_t utc_ns = 0;                                  ///< when the server made it
};

/// A running stream of the arm's contacts; ends when destroyed. Next from one thread, Cancel from any.
class ContactReader {
 public:
  ~ContactReader();
  ContactReader(const ContactReader&) = delete;
  ContactReader& operator=(const ContactReader&) = delete;

  /// Waits for the next message. Errors: kTimeout (call again), kEndOfData (cancelled), kUnavailable.
  Result<ArmContacts> Next(std::chrono::milliseconds timeout);
  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

 private:
  friend class Client;
  struct Call;
  explicit ContactReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

/// Where joints are at one instant.
struct JointStates {
  std::vector<std::string> names;  ///< none: as in the message before
  std::vector<double> positions;   ///< rad; prismatic: m
  std::vector<double> velocities;  ///< rad/s or m/s; or none
  int64_t utc_ns = 0;              ///< of the positions, since 1970-01-01
};

struct JointStateSummary {
  uint64_t accepted = 0;
  uint64_t refused = 0;       ///< without fault and without use
  std::string first_refusal;  ///< why; empty: none was
};

/// Tells the server where the arm's joints are. One thread.
class JointStateWriter {
 public:
  ~JointStateWriter();
  JointStateWriter(const JointStateWriter&) = delete;
  JointStateWriter& operator=(const JointStateWriter&) = delete;

  /// Waits while the server is behind. Errors: why the server ended the call (kInvalidArgument: which message
  /// and what is wrong); after an error there is nothing more to write.
  Result<void> Write(const JointStates& states);
  /// Ends the call. Errors: as Write's.
  Result<JointStateSummary> Finish();

 private:
  friend class Client;
  struct Call;
  explicit JointStateWriter(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

}  // namespace taclink::client
