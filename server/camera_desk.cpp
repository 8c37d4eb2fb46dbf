#include "server/camera_desk.h"

#include <utility>

#include "server/source_supervisor.h"

namespace taclink::server {
namespace {

constexpr size_t kMostWaiting = 16;

}  // namespace

Result<void> CameraDesk::Order(const CameraOrder& order, CameraObserver observer) {
  const std::lock_guard lock(mutex_);
  if (closed_) return Error{ErrorCode::kUnavailable, "the link's worker has ended; try again when it runs"};
  if (jobs_.size() >= kMostWaiting)
    return Error{ErrorCode::kResourceExhausted, "too many camera settings wait; try again"};
  jobs_.push_back({order, std::move(observer)});
  return {};
}

std::vector<CameraDesk::Job> CameraDesk::TakeJobs() {
  const std::lock_guard lock(mutex_);
  return std::exchange(jobs_, {});
}

void CameraDesk::CarryOut(SourceSupervisor& source) {
  for (const Job& job : TakeJobs()) {
    Result<void> done;
    for (const CameraId id : kBothCameras)
      if (done && job.order.cameras[Index(id)]) done = source.SetCamera(id, job.order.settings);
    job.observer(done);
  }
}

void CameraDesk::End(const Error& why) {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  for (const Job& job : TakeJobs()) job.observer(why);
}

}  // namespace taclink::server
