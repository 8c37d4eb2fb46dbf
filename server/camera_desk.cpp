#include "server/camera_desk.h"

#include <utility>

#include "server/source_supervisor.h"

namespace taclink::server {
namespace {

constexpr size_t kMostWaiting = 16;

}  // namespace

void CameraMemory::Keep(const CameraOrder& order) {
  const std::lock_guard lock(mutex_);
  for (const CameraId id : kBothCameras)
    if (order.cameras[Index(id)]) settings_[Index(id)].Take(order.settings);
}

void CameraMemory::Tell(FrameSource& source) const {
  const std::lock_guard lock(mutex_);
  for (const CameraId id : kBothCameras) source.Remember(id, settings_[Index(id)]);
}

Result<void> CameraDesk::Order(const CameraOrder& order, CameraObserver observer) {
  const std::lock_guard lock(mutex_);
  if (closed_) return Error{ErrorCode::kUnavailable, "the link's worker has ended; try again when it runs"};
  if (jobs_.size() >= kMostWaiting)
    return Error{ErrorCode::kResourceExhausted, "too many camera settings wait; try again"};
  jobs_.push_back({order, std::move(observer)});
  return {};
}

void CameraDesk::CarryOut(SourceSupervisor& source) {
  while (true) {
    CameraOrder order;
    {
      const std::lock_guard lock(mutex_);
      if (jobs_.empty()) return;
      order = jobs_.front().order;
    }
    Result<void> done;
    for (const CameraId id : kBothCameras)
      if (done && order.cameras[Index(id)]) done = source.SetCamera(id, order.settings);
    CameraObserver observer;
    {
      const std::lock_guard lock(mutex_);
      if (jobs_.empty()) return;  // told meanwhile, by End
      observer = std::move(jobs_.front().observer);
      jobs_.pop_front();
    }
    observer(done);
  }
}

void CameraDesk::End(const Error& why) {
  std::deque<Job> jobs;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    jobs.swap(jobs_);
  }
  for (const Job& job : jobs) job.observer(why);
}

}  // namespace taclink::server
