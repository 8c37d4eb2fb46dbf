#include "server/recording/loss_book.h"

#include <algorithm>

namespace taclink::server {
namespace {

constexpr size_t Place(LogStage stage) {
  return static_cast<size_t>(stage);
}

}  // namespace

void LossBook::Wrote(size_t link, uint64_t sequence) {
  ++written_;
  ++links_[link].batches[Place(LogStage::kOpen)].frames;
  links_[link].newest = sequence;
}

void LossBook::Told(size_t link, uint64_t count) {
  PerLink& at = links_[link];
  at.batches[Place(LogStage::kOpen)].told += count;
  at.untold = 0;
  at.lost_until = 0;
  at.text.clear();
}

void LossBook::MoveOn(LogStage from) {
  for (PerLink& link : links_) {
    Batch& batch = link.batches[Place(from)];
    Batch& next = link.batches[Place(from) - 1];
    next.frames += batch.frames;
    next.told += batch.told;
    // What is behind it begins where it ended.
    const bool is_last = from == LogStage::kOpen;
    batch = {.after = is_last ? link.newest : link.batches[Place(from) + 1].after};
  }
}

void LossBook::Taken() {
  MoveOn(LogStage::kOpen);
}

void LossBook::Synced() {
  MoveOn(LogStage::kTaken);
}

void LossBook::NextLog() {
  for (PerLink& link : links_) link.batches.fill({.after = link.newest});
}

void LossBook::Lose(PerLink& link, uint64_t count, uint64_t after, v1::LossReason reason,
                    const std::string& text) {
  if (link.untold == 0) link.after = after;
  link.untold += count;
  link.reason = reason;
  link.text = text;
}

void LossBook::Lost(LogStage stage, const std::string& text) {
  for (PerLink& link : links_) {
    const uint64_t after = link.batches[Place(stage)].after;
    uint64_t frames = 0, told = 0;
    for (size_t i = Place(stage); i < link.batches.size(); ++i) {
      frames += link.batches[i].frames;
      told += link.batches[i].told;
      link.batches[i] = {.after = after};
    }
    lost_ += frames;
    written_ -= frames;
    if (frames + told > 0) {
      Lose(link, frames + told, after, v1::LOSS_REASON_DISK, text);
      link.after = std::min(link.after, after);  // also of what was lost after these had been handed over
      link.lost_until = std::max(link.lost_until, link.newest);
    }
    link.newest = after;
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
  loss.set_before_sequence(next_sequence == 0 ? 0 : std::max(next_sequence, at.lost_until + 1));
  loss.set_reason(at.reason);
  loss.set_text(at.text);
  return loss;
}

}  // namespace taclink::server
