#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "taclink/v1/log.pb.h"

namespace taclink::server {

/// Which frames of each link are in the log for sure, which wait in a chunk that may yet fail, and which are
/// lost and not yet told of. One thread.
class LossBook {
 public:
  explicit LossBook(size_t links) : links_(links) {}

  /// A frame was handed to the writer.
  void Wrote(size_t link, uint64_t sequence);
  /// A told loss was handed to the writer.
  void Told(size_t link, uint64_t count);
  /// Everything handed over is in the file.
  void Kept();
  /// What was handed over since Kept is not in the file, nor will it be.
  void ChunkLost(const std::string& text);
  /// Frames that fell out of the queue before the next one of this link.
  void Dropped(size_t link, uint64_t count);

  /// What is to be told of a link before frame `next_sequence` (0: the end); the link's name and the time are
  /// not set.
  std::optional<v1::RecordingLoss> Untold(size_t link, uint64_t next_sequence) const;
  uint64_t lost() const { return lost_; }        ///< frames, of all links
  uint64_t written() const { return written_; }  ///< frames that are in the file or may yet be
  size_t links() const { return links_.size(); }

 private:
  struct PerLink {
    uint64_t kept = 0;       // sequence of the last frame that is in the file
    uint64_t newest = 0;     // that was handed over; kept, if none is
    uint64_t open = 0;       // frames handed over since Kept
    uint64_t open_told = 0;  // losses told since Kept
    uint64_t untold = 0;
    uint64_t after = 0;  // the last frame before the untold ones
    v1::LossReason reason = v1::LOSS_REASON_UNSPECIFIED;
    std::string text;
  };
  void Lose(PerLink& link, uint64_t count, uint64_t after, v1::LossReason reason, const std::string& text);

  std::vector<PerLink> links_;
  uint64_t lost_ = 0, written_ = 0;
};

}  // namespace taclink::server
