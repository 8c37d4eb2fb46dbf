#include "server/replay/log_gaps.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "mcap/cursor.h"

namespace taclink::server {
namespace {

int64_t SignedNs(uint64_t time_ns) {
  return static_cast<int64_t>(std::min<uint64_t>(time_ns, std::numeric_limits<int64_t>::max()));
}

// A chunk that itself spans a gap: the clock was set while it was open. Reads no more than `most` messages.
void AddMessages(const mcap::Reader& reader, const mcap::ChunkIndex& chunk, size_t& most,
                 std::vector<std::pair<int64_t, int64_t>>& spans) {
  mcap::MessageCursor cursor(reader, {.start_ns = chunk.message_start_ns, .end_ns = chunk.message_end_ns});
  for (; most > 0; --most) {
    const auto message = cursor.Next();
    if (!message && message.error().code == ErrorCode::kEndOfData) return;
    if (message) spans.emplace_back(SignedNs(message->log_time_ns), SignedNs(message->log_time_ns));
  }
}

}  // namespace

LogGaps::LogGaps(const mcap::Reader& reader) {
  size_t most = 100'000;  // in all: a log of few messages may have nothing but long chunks
  std::vector<std::pair<int64_t, int64_t>> spans;
  for (const mcap::ChunkIndex& chunk : reader.chunk_indexes()) {
    const std::pair span(SignedNs(chunk.message_start_ns), SignedNs(chunk.message_end_ns));
    if (span.second - span.first >= kLeastGapNs) AddMessages(reader, chunk, most, spans);
    if (span.second - span.first < kLeastGapNs || most == 0) spans.push_back(span);
  }
  std::sort(spans.begin(), spans.end());
  for (size_t i = 0, newest = 0; i < spans.size(); ++i) {
    const int64_t end_ns = spans[newest].second;
    if (i > 0 && spans[i].first - end_ns >= kLeastGapNs) gaps_.push_back({end_ns, spans[i].first});
    if (spans[i].second >= end_ns) newest = i;
  }
}

int64_t LogGaps::PlayedNs(int64_t log_utc_ns) const {
  int64_t left_out = 0;
  for (const Gap& gap : gaps_) {
    if (log_utc_ns <= gap.begin_utc_ns + kPauseNs) break;
    left_out += std::min(log_utc_ns, gap.end_utc_ns) - gap.begin_utc_ns - kPauseNs;
  }
  return log_utc_ns - left_out;
}

int64_t LogGaps::LogUtcNs(int64_t played_ns) const {
  int64_t log_utc_ns = played_ns;
  for (const Gap& gap : gaps_) {
    if (log_utc_ns <= gap.begin_utc_ns) break;
    if (log_utc_ns < gap.begin_utc_ns + kPauseNs) return gap.end_utc_ns;
    log_utc_ns += gap.end_utc_ns - gap.begin_utc_ns - kPauseNs;
  }
  return log_utc_ns;
}

}  // namespace taclink::server
