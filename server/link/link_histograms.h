#pragma once

#include "sensing/core/link_state.h"
#include "server/link/latency_histogram.h"

namespace taclink::server {

/// How long a link's frames take, since the start. One thread records, any may read.
struct LinkHistograms {
  LatencyHistogram latency;                                        ///< exposure to published
  LatencyHistogram capture;                                        ///< exposure to both pictures in memory
  LatencyHistogram decode, detect, register_, reconstruct, force;  ///< as StageTimes; those that ran

  void Record(const LinkState& state) {
    constexpr double kMsPerNs = 1e-6;
    const FrameTimes& times = state.times;
    if (times.exposure_monotonic_ns == 0 || state.replayed) return;
    latency.Add(static_cast<double>(times.published_ns - times.exposure_monotonic_ns) * kMsPerNs);
    if (times.received_ns != 0)
      capture.Add(static_cast<double>(times.received_ns - times.exposure_monotonic_ns) * kMsPerNs);
    const auto add = [](LatencyHistogram& histogram, double ms) {
      if (ms > 0) histogram.Add(ms);
    };
    add(decode, state.stage_ms.decode);
    add(detect, state.stage_ms.detect);
    add(register_, state.stage_ms.register_);
    add(reconstruct, state.stage_ms.reconstruct);
    add(force, state.stage_ms.force);
  }
};

}  // namespace taclink::server
