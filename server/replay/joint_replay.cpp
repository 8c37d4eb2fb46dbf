#include "server/replay/joint_replay.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>
#include <vector>

#include "sensing/core/thread_start.h"
#include "server/process/system_limits.h"
#include "taclink/v1/log.pb.h"

namespace taclink::server {
namespace {

constexpr int64_t kAheadNs = 100'000'000;  // so that frames lie between two states
constexpr int64_t kPollNs = 50'000'000;

}  // namespace

JointReplay::JointReplay(std::unique_ptr<ReplayTrack> track, ArmPoses& poses, Clock& clock)
    : track_(std::move(track)), poses_(poses), clock_(clock) {
  for (const JointInfo& joint : poses.joints().joints()) joints_.emplace(joint.name, joints_.size());
  thread_ = MustStartThread("joint-replay", [this](const std::stop_token& stop) { Run(stop); });
}

JointReplay::~JointReplay() = default;

void JointReplay::Run(const std::stop_token& stop) {
  try {
    while (true) {
      const auto item = track_->Next();
      if (!item || !WaitUntil(item->due_ns - kAheadNs, stop)) return;
      Take(*item);
    }
  } catch (const std::exception& e) {
    SPDLOG_ERROR("the log's joint states are given up: {}", DescribeLimit(e));
  }
}

bool JointReplay::WaitUntil(int64_t time_ns, const std::stop_token& stop) {
  for (int64_t now_ns = clock_.MonotonicNs(); now_ns < time_ns && !stop.stop_requested();
       now_ns = clock_.MonotonicNs())
    clock_.SleepUntilMonotonicNs(std::min(time_ns, now_ns + kPollNs));
  return !stop.stop_requested();
}

void JointReplay::Take(const ReplayTrack::Item& item) {
  v1::JointSample sample;
  if (!sample.ParseFromArray(item.data.data(), static_cast<int>(item.data.size()))) return;
  std::vector<size_t> places;
  std::vector<double> positions, velocities;
  const bool moving = sample.velocities_size() == sample.names_size();
  for (int i = 0; i < std::min(sample.names_size(), sample.positions_size()); ++i) {
    const auto joint = joints_.find(sample.names(i));
    if (joint == joints_.end()) continue;
    places.push_back(joint->second);
    positions.push_back(sample.positions(i));
    if (moving) velocities.push_back(sample.velocities(i));
  }
  // What is refused is no position; the poses then tell that they are old.
  static_cast<void>(poses_.joints().Add(
      {.time_ns = item.due_ns, .joints = places, .positions = positions, .velocities = velocities}));
}

}  // namespace taclink::server
