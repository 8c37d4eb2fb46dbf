#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "sensing/core/clock.h"

namespace taclink::server {

/// What a link's thread is doing.
enum class WorkStage : uint8_t {
  kWait,         ///< for a frame, or before the next attempt to start the source
  kSourceStart,  ///< FrameSource::Start
  kSourceNext,   ///< FrameSource::Next
  kFirstFrames,  ///< the processor, while it calibrates or has not measured yet
  kFrame,        ///< the processor
  kPublish,      ///< hand-over to the hub
};
inline constexpr size_t kWorkStageCount = 6;
inline constexpr std::array<const char*, kWorkStageCount> kWorkStageNames = {
    "waiting",
    "starting the source",
    "waiting for the source's next frame",
    "processing the first frames",
    "taking a frame through FEM",
    "publishing"};
inline const char* Name(WorkStage stage) {
  return kWorkStageNames[static_cast<size_t>(stage)];
}

/// What a thread does now and since when: written by it, read by the watchdog. One word, so that stage and
/// time always belong together.
class StageMark {
 public:
  struct Reading {
    WorkStage stage;
    int64_t since_ns;  ///< monotonic, whole microseconds
  };

  void Begin(WorkStage stage, int64_t now_ns) {
    word_.store(static_cast<uint64_t>(now_ns / kNsPerUs) << kStageBits | static_cast<uint64_t>(stage),
                std::memory_order_release);
  }
  Reading Read() const {
    const uint64_t word = word_.load(std::memory_order_acquire);
    return {static_cast<WorkStage>(word & ((1U << kStageBits) - 1)),
            static_cast<int64_t>(word >> kStageBits) * kNsPerUs};
  }

 private:
  static constexpr int64_t kNsPerUs = 1000;
  static constexpr unsigned kStageBits = 8;  // leaves 56 bits of microseconds, 2000 years

  std::atomic<uint64_t> word_ = 0;
};

/// Marks a stage while it lives, then waiting. Without a mark it does nothing.
class StageScope {
 public:
  StageScope(StageMark* mark, WorkStage stage, const Clock& clock) : mark_(mark), clock_(clock) {
    if (mark_ != nullptr) mark_->Begin(stage, clock_.MonotonicNs());
  }
  ~StageScope() {
    if (mark_ != nullptr) mark_->Begin(WorkStage::kWait, clock_.MonotonicNs());
  }
  StageScope(const StageScope&) = delete;
  StageScope& operator=(const StageScope&) = delete;

 private:
  StageMark* const mark_;
  const Clock& clock_;
};

}  // namespace taclink::server
