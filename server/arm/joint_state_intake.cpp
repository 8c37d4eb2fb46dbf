#include "server/arm/joint_state_intake.h"

#include <set>
#include <utility>

#include "server/arm/client_time.h"

namespace taclink::server {
namespace {

Error InvalidJoints(std::string what) {
  return {ErrorCode::kInvalidArgument, std::move(what)};
}

std::string List(const std::vector<JointInfo>& joints) {
  std::string out;
  for (const JointInfo& joint : joints) out += (out.empty() ? "" : ", ") + joint.name;
  return out;
}

}  // namespace

Result<void> JointStateIntake::Take(const JointMessage& message) {
  const auto good = Check(message);
  return good ? good : AtNextMessage(good.error());
}

Error JointStateIntake::AtNextMessage(const Error& error) const {
  const uint64_t number = counts_.accepted + counts_.refused + 1;
  return {error.code, "joint states, message " + std::to_string(number) + " of this call: " + error.message +
                          "; " + std::to_string(counts_.accepted) + " before it were accepted"};
}

Result<void> JointStateIntake::Check(const JointMessage& message) {
  if (poses_.kinematics() == nullptr)
    return Error{ErrorCode::kFailedPrecondition, "the arm has no URDF; set arm.urdf in the configuration"};
  if (!message.names.empty()) {
    if (const auto named = SetNames(message.names); !named) return named.error();
  }
  if (!named_) return InvalidJoints("the first message must name the joints");
  if (message.positions.size() != names_)
    return InvalidJoints(std::to_string(message.positions.size()) + " positions for " +
                         std::to_string(names_) + " joints");
  if (!message.velocities.empty() && message.velocities.size() != names_)
    return InvalidJoints(std::to_string(message.velocities.size()) + " velocities for " +
                         std::to_string(names_) + " joints; give one for each, or none");
  const auto time_ns = TimeOf(message);
  if (!time_ns) return time_ns.error();

  positions_.clear();
  velocities_.clear();
  for (const size_t place : places_) {
    positions_.push_back(message.positions[place]);
    if (!message.velocities.empty()) velocities_.push_back(message.velocities[place]);
  }
  const auto taken = poses_.joints().Add(
      {.time_ns = *time_ns, .joints = joints_, .positions = positions_, .velocities = velocities_});
  if (!taken) return taken.error();
  if (*taken > 0 || joints_.empty()) {
    ++counts_.accepted;
  } else {
    Refuse(*time_ns == last_ns_ ? "the time of the message before, again"
                                : "another client has given newer states of these joints");
  }
  last_ns_ = *time_ns;
  return {};
}

Result<void> JointStateIntake::SetNames(const std::vector<std::string>& names) {
  const ArmKinematics& kinematics = *poses_.kinematics();
  std::set<std::string> seen;
  std::vector<size_t> places, joints;
  for (size_t place = 0; place < names.size(); ++place) {
    const std::string& name = names[place];
    if (!seen.insert(name).second) return InvalidJoints("joint '" + name + "' is named twice");
    const auto joint = kinematics.FindJoint(name);
    if (!joint && kinematics.IsDependent(name)) continue;  // follows from the others
    if (!joint) return InvalidJoints("no joint '" + name + "'; there are: " + List(kinematics.joints()));
    places.push_back(place);
    joints.push_back(*joint);
  }
  named_ = true;
  names_ = names.size();
  places_ = std::move(places);
  joints_ = std::move(joints);
  return {};
}

Result<int64_t> JointStateIntake::TimeOf(const JointMessage& message) const {
  const auto given_ns = MonotonicOf(message.utc_ns, message.monotonic_ns, clock_);
  if (!given_ns) return given_ns.error();
  const int64_t time_ns = *given_ns;
  // The two clocks drift against each other by less than this between two messages.
  constexpr int64_t kJitterNs = 100'000;
  if (time_ns >= last_ns_ || last_ns_ == 0) return time_ns;
  if (message.utc_ns != 0 && last_ns_ - time_ns < kJitterNs) return last_ns_;
  return InvalidJoints("its time is " + SecondsText(last_ns_ - time_ns) +
                       " before that of the message before");
}

void JointStateIntake::Refuse(std::string why) {
  if (counts_.refused++ == 0) counts_.first_refusal = std::move(why);
}

}  // namespace taclink::server
