#pragma once

#include <map>
#include <memory>
#include <string>
#include <thread>

#include "sensing/core/clock.h"
#include "server/arm/arm_poses.h"
#include "server/replay/replay_track.h"

namespace taclink::server {

/// Tells an arm's poses the joint states of a log, a moment before they are due. A thread of its own; the
/// poses outlive it.
class JointReplay {
 public:
  JointReplay(std::unique_ptr<ReplayTrack> track, ArmPoses& poses, Clock& clock);
  ~JointReplay();

 private:
  void Run(const std::stop_token& stop);
  void Take(const ReplayTrack::Item& item);
  bool WaitUntil(int64_t time_ns, const std::stop_token& stop);

  // Constant after construction.
  const std::unique_ptr<ReplayTrack> track_;
  ArmPoses& poses_;
  Clock& clock_;
  std::map<std::string, size_t> joints_;  // to their places

  std::jthread thread_;
};

}  // namespace taclink::server
