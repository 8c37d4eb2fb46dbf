#include "server/recording/loss_book.h"

namespace taclink::server {

void LossBook::Wrote(size_t link, uint64_t sequence) {
  ++written_;
  ++links_[link].open;
  links_[link].newest = sequence;
}

void LossBook::Told(size_t link, uint64_t count) {
  PerLink& at = links_[link];
  at.open_told += count;
  at.untold = 0;
  at.text.clear();
}

void LossBook::Kept() {
  for (PerLink& link : links_) {
    link.kept = link.newest;
    link.open = link.open_told = 0;
  }
}

void LossBook::Lose(PerLink& link, uint64_t count, uint64_t after, v1::LossReason reason,
                    const std::string& text) {
  if (link.untold == 0) link.after = after;
  link.untold += count;
  link.reason = reason;
  link.text = text;
}

void LossBook::ChunkLost(const std::string& text) {
  for (PerLink& link : links_) {
    lost_ += link.open;
    written_ -= link.open;
    const uint64_t untold = link.open + link.open_told;
    if (untold > 0) {
      Lose(link, untold, link.kept, v1::LOSS_REASON_DISK, text);
      link.after = link.kept;  // also of what was lost after the chunk had begun
    }
    link.newest = link.kept;
    link.open = link.open_told = 0;
  }
}

void LossBook::Dropped(size_t link, uint64_t count) {
  if (count == 0) return;
  lost_ += count;
  Lose(links_[link], count, links_[link].newest, v1::LOSS_REASON_SLOW,
       "the disk is too slow for what is recorded, or recording.queue_mb too small");
}

std::optional<v1::RecordingLoss> LossBook::Untold(size_t link, uint64_t next_sequence) const {
  const PerLink& at = links_[link];
  if (at.untold == 0) return std::nullopt;
  v1::RecordingLoss loss;
  loss.set_count(at.untold);
  loss.set_after_sequence(at.after);
  loss.set_before_sequence(next_sequence);
  loss.set_reason(at.reason);
  loss.set_text(at.text);
  return loss;
}

}  // namespace taclink::server
