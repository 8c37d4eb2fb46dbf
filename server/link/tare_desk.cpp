#include "server/link/tare_desk.h"

#include <utility>

namespace taclink::server {

Result<void> TareDesk::Order(const TareOptions& options, TareObserver observer) {
  const std::lock_guard lock(mutex_);
  if (closed_) return Error{ErrorCode::kUnavailable, "the link's worker has ended; try again when it runs"};
  if (observer_) return Error{ErrorCode::kFailedPrecondition, "a tare is under way; wait for its end"};
  ordered_ = options;
  observer_ = std::move(observer);
  return {};
}

void TareDesk::Begin(LinkProcessor& processor, int64_t now_ns) {
  {
    const std::lock_guard lock(mutex_);
    if (!ordered_) return;
    job_ = std::exchange(ordered_, std::nullopt);
  }
  begun_ns_ = now_ns;
  if (const auto begun = processor.BeginTare(*job_); !begun) Finish(begun.error());
}

void TareDesk::Poll(LinkProcessor& processor, int64_t now_ns, int64_t patience_ns) {
  if (!job_) return;
  if (const auto end = processor.TakeTareEnd()) return Finish(*end);
  if (now_ns - begun_ns_ <= patience_ns) return;
  processor.CancelTare();
  Finish(Error{ErrorCode::kUnavailable, "the link gives too few frames; see its status"});
}

void TareDesk::End(LinkProcessor& processor, const Error& why) {
  Begin(processor, 0);  // one that was ordered meanwhile
  if (!job_) return;
  processor.CancelTare();
  Finish(why);
}

void TareDesk::Finish(const Result<TareSummary>& end) {
  job_.reset();
  TareObserver observer;
  {
    const std::lock_guard lock(mutex_);
    observer = std::exchange(observer_, nullptr);
  }
  if (observer) observer(end);
}

void TareDesk::EndFromOutside(const Error& why) {
  TareObserver observer;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    ordered_.reset();
    observer = std::exchange(observer_, nullptr);
  }
  if (observer) observer(why);
}

}  // namespace taclink::server
