#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/arm/arm.h"
#include "server/hub/rate_limit.h"
#include "server/recording/log_clock.h"
#include "taclink/v1/contacts.pb.h"
#include "wire/log/log_writer.h"

namespace taclink::server {

/// All that a log holds of the arm beside the links' frames: events, joint states, contacts in the base
/// frame, the arm's description once a second, and what Foxglove draws. One thread.
class ArmRecorder {
 public:
  using Topic = wire::log::Topic;
  /// Hands a message on to the log.
  using Write = std::function<void(const Topic& topic, const google::protobuf::Message& message,
                                   const wire::log::Stamp& stamp)>;

  /// Events and joint states from now on. The arm and `log_clock`, which gives log times, must outlive it.
  ArmRecorder(Arm& arm, const LogClock& log_clock, double scene_rate_hz, Write write);

  /// A new log has begun: what does not change is told again.
  void BeginLog();
  /// What a frame means for the arm.
  void TakeFrame(const Publication& publication, int64_t utc_ns);
  /// Events, joint states and, if it is time, the arm.
  void TakeRest();

  uint64_t events() const { return events_; }
  uint64_t contacts_begun() const { return contacts_begun_; }  ///< in this log

 private:
  void TakeEvents();
  void TakeJoints();
  void TakeArm();
  void TakeScene(const Publication& publication, const LinkContacts& contacts, int64_t utc_ns);

  // Constant after construction.
  Arm& arm_;
  const LogClock& log_clock_;
  const Write write_;
  const std::vector<std::string> link_names_;
  const std::vector<JointInfo> joints_;

  std::unique_ptr<EventCursor> event_cursor_;
  std::vector<int64_t> joint_times_;  // by joint: of the newest state taken, monotonic
  int64_t arm_ns_ = 0;                // the arm was told, monotonic; 0: not in this log
  RateLimit contact_rate_;
  std::vector<RateLimit> scene_rates_;                       // by link
  std::vector<std::shared_ptr<const LinkContacts>> newest_;  // by link
  v1::StreamContactsResponse contacts_message_;
  uint64_t contacts_sequence_ = 0;
  uint64_t events_ = 0;
  uint64_t contacts_begun_ = 0;
};

}  // namespace taclink::server
