#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "taclink/v1/log.pb.h"

namespace taclink::server {

/// How far frames have come on their way to the disk, from the last stage to the first.
enum class LogStage : int {
  kSafe,   ///< in the log, and safe from a power cut
  kTaken,  ///< in the log's file, but not synced
  kOpen,   ///< in a chunk that the file has not taken yet
};
inline constexpr int kLogStages = 3;

/// Which frames of each link have come how far, and which are lost and not yet told of. One thread.
class LossBook {
 public:
  explicit LossBook(size_t links) : links_(links) {}

  /// A frame was handed to the writer.
  void Wrote(size_t link, uint64_t sequence);
  /// A told loss was handed to the writer.
  void Told(size_t link, uint64_t count);
  /// Everything handed over is in the file.
  void Taken();
  /// Everything that is in the file is safe.
  void Synced();
  /// The next log has begun, and the one before is complete.
  void NextLog();
  /// What had come as far as that stage, or less far, is lost. kSafe: all of this log.
  void Lost(LogStage stage, const std::string& text);
  /// Frames that fell out of the queue before the next one of this link.
  void Dropped(size_t link, uint64_t count);

  /// What is to be told of a link before what has the number `next_sequence` (0: the end), which of a report
  /// is that of the frame before it; the link's name and the time are not set.
  std::optional<v1::RecordingLoss> Untold(size_t link, uint64_t next_sequence) const;
  uint64_t lost() const { return lost_; }        ///< frames, of all links
  uint64_t written() const { return written_; }  ///< frames that are in a log or may yet be
  size_t links() const { return links_.size(); }

 private:
  struct Batch {
    uint64_t after = 0;  // sequence of the last frame before it
    uint64_t frames = 0;
    uint64_t told = 0;  // of losses
  };
  struct PerLink {
    std::array<Batch, kLogStages> batches;  // by stage
    uint64_t newest = 0;                    // that was handed over
    uint64_t untold = 0;
    uint64_t after = 0;       // the last frame before the untold ones
    uint64_t lost_until = 0;  // the newest of them that had been handed over
    v1::LossReason reason = v1::LOSS_REASON_UNSPECIFIED;
    std::string text;
  };
  // Each batch from `from` on goes on to the stage before.
  void MoveOn(LogStage from);
  void Lose(PerLink& link, uint64_t count, uint64_t after, v1::LossReason reason, const std::string& text);

  std::vector<PerLink> links_;
  uint64_t lost_ = 0, written_ = 0;
};

}  // namespace taclink::server
