#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "sensing/core/baseline.h"
#include "sensing/core/result.h"
#include "server/link/link_processor.h"

namespace taclink::server {

/// Called once, on the FEM thread or that which gives it up.
using TareObserver = std::function<void(const Result<TareSummary>&)>;

/// Where tares of a link are ordered, and from where its FEM thread carries them out.
class TareDesk {
 public:
  /// Any thread. Errors: kFailedPrecondition (one is under way). All else is told to the observer.
  Result<void> Order(const TareOptions& options, TareObserver observer);

  // On the FEM thread.
  /// Before each frame, or after waiting for one in vain.
  void Begin(LinkProcessor& processor, int64_t now_ns);
  /// Likewise, after the frame was processed: ends a tare that is complete, refused, or older than
  /// `patience_ns`.
  void Poll(LinkProcessor& processor, int64_t now_ns, int64_t patience_ns);
  /// The link stops.
  void End(LinkProcessor& processor, const Error& why);

  /// Any thread: the FEM thread died or hangs, and will not tell. No order is taken any more.
  void EndFromOutside(const Error& why);

 private:
  void Finish(const Result<TareSummary>& end);

  std::mutex mutex_;
  // Guarded by mutex_.
  std::optional<TareOptions> ordered_;
  TareObserver observer_;  // set: ordered or under way
  bool closed_ = false;

  // Used by the FEM thread only.
  std::optional<TareOptions> job_;
  int64_t begun_ns_ = 0;
};

}  // namespace taclink::server
