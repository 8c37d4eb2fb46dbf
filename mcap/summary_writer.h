#pragma once

#include <ranges>
#include <vector>

#include "mcap/crc32.h"
#include "mcap/records.h"

namespace taclink::mcap {

/// Appends a log's summary, group by group, its offsets, the footer and the last magic to `out`, whose first
/// byte stands at `base` in the file.
class SummaryWriter {
 public:
  SummaryWriter(uint64_t base, bool crc, Buffer& out)
      : base_(base), crc_(crc), out_(out), start_(out.size()) {}

  /// All records of one type; none if `records` are empty.
  void Add(Opcode opcode, const auto& records) {
    const size_t before = out_.size();
    for (const auto& record : records) Append(record, out_);
    if (out_.size() == before) return;
    groups_.push_back(
        {.group_opcode = opcode, .group_start = base_ + before, .group_length = out_.size() - before});
  }

  void Finish() {
    const uint64_t offsets = out_.size();
    for (const SummaryOffset& group : groups_) Append(group, out_);
    Append(Footer{.summary_start = groups_.empty() ? 0 : base_ + start_,
                  .summary_offset_start = groups_.empty() ? 0 : base_ + offsets},
           out_);
    const size_t crc_at = out_.size() - sizeof(uint32_t);
    if (crc_) PutNumber(Crc32(Bytes(out_).subspan(start_, crc_at - start_)), crc_at, out_);
    AppendBytes(kMagic, out_);
  }

 private:
  const uint64_t base_;
  const bool crc_;
  Buffer& out_;
  const size_t start_;
  std::vector<SummaryOffset> groups_;
};

}  // namespace taclink::mcap
