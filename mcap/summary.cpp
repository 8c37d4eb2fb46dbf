#include "mcap/summary.h"

#include <algorithm>
#include <array>

#include "mcap/crc32.h"

namespace taclink::mcap {
namespace {

template <typename T, typename Keep>
Result<void> Take(Bytes content, Keep keep) {
  auto record = Decode<T>(content);
  if (!record) return record.error();
  keep(std::move(*record));
  return {};
}

Result<void> TakeInto(Summary& out, const RawRecord& record) {
  switch (record.opcode) {
    case Opcode::kSchema:
      return Take<Schema>(record.content,
                          [&](Schema s) { out.schemas.insert_or_assign(s.id, std::move(s)); });
    case Opcode::kChannel:
      return Take<Channel>(record.content,
                           [&](Channel c) { out.channels.insert_or_assign(c.id, std::move(c)); });
    case Opcode::kStatistics:
      return Take<Statistics>(record.content, [&](Statistics s) { out.statistics = std::move(s); });
    case Opcode::kChunkIndex:
      return Take<ChunkIndex>(record.content,
                              [&](ChunkIndex i) { out.chunk_indexes.push_back(std::move(i)); });
    case Opcode::kAttachmentIndex:
      return Take<AttachmentIndex>(
          record.content, [&](AttachmentIndex i) { out.attachment_indexes.push_back(std::move(i)); });
    case Opcode::kMetadataIndex:
      return Take<MetadataIndex>(record.content,
                                 [&](MetadataIndex i) { out.metadata_indexes.push_back(std::move(i)); });
    default:
      return {};
  }
}

Result<void> TakeAll(Bytes bytes, uint64_t offset, Summary& out) {
  const uint64_t end = offset + bytes.size();
  while (!bytes.empty()) {
    const uint64_t at = end - bytes.size();
    const auto record = TakeRecord(bytes);
    if (!record) return At(at, record.error());
    if (const auto taken = TakeInto(out, *record); !taken) return At(at, taken.error());
  }
  std::ranges::stable_sort(out.chunk_indexes, {}, &ChunkIndex::chunk_start);
  return {};
}

}  // namespace

Result<PlacedFooter> ReadFooter(const ByteSource& source) {
  constexpr size_t kEndBytes = kRecordHeaderBytes + kFooterBytes + kMagic.size();
  if (source.size() < kMagic.size() + kEndBytes) {
    return Error{ErrorCode::kInvalidArgument, "the log is too short to have an end"};
  }
  std::array<std::byte, kEndBytes> bytes{};
  const uint64_t offset = source.size() - kEndBytes;
  if (const auto read = source.Read(offset, bytes); !read) return read.error();
  if (!std::ranges::equal(Bytes(bytes).last(kMagic.size()), kMagic)) {
    return At(offset, "the log does not end with MCAP's magic bytes: it was not closed, or is cut off");
  }
  Bytes rest = bytes;
  const auto record = TakeRecord(rest);
  if (!record || record->opcode != Opcode::kFooter || record->content.size() != kFooterBytes) {
    return At(offset, "the footer is damaged");
  }
  return PlacedFooter{.footer = *Decode<Footer>(record->content), .offset = offset};
}

Result<Summary> ReadSummary(const ByteSource& source, const Limits& limits) {
  auto summary = ReadSummarySection(source, limits);
  if (!summary) return summary;
  Buffer buffer;
  auto header = ReadRecordAs<Header>(source, Opcode::kHeader, kMagic.size(), limits, buffer);
  if (!header) return header.error();
  summary->header = std::move(*header);
  return summary;
}

namespace {

Result<Summary> ReadSummaryFrom(const ByteSource& source, uint64_t start, const PlacedFooter& end) {
  // The footer's fields before its CRC belong to what the CRC covers.
  Buffer bytes(static_cast<size_t>(end.offset - start + kRecordHeaderBytes + 16));
  if (const auto read = source.Read(start, bytes); !read) return read.error();
  if (end.footer.summary_crc != 0 && Crc32(bytes) != end.footer.summary_crc) {
    return At(start, "the summary's CRC is wrong: it is damaged");
  }
  Summary summary;
  const auto taken = TakeAll(Bytes(bytes).first(static_cast<size_t>(end.offset - start)), start, summary);
  if (!taken) return taken.error();
  return summary;
}

}  // namespace

Result<Summary> ReadSummarySection(const ByteSource& source, const Limits& limits) {
  const auto end = ReadFooter(source);
  if (!end) return end.error();
  const uint64_t start = end->footer.summary_start;
  if (start == 0) return Error{ErrorCode::kNotFound, "the log has no summary"};
  if (start < kMagic.size() || start > end->offset) {
    return At(end->offset,
              "the footer places the summary at " + std::to_string(start) + ", where it can't be");
  }
  if (end->offset - start > limits.record_bytes) {
    return At(start,
              Error{ErrorCode::kResourceExhausted,
                    "the summary is above the limit of " + std::to_string(limits.record_bytes) + " bytes"});
  }
  return ReadSummaryFrom(source, start, *end);
}

Result<Summary> FindMovedSummary(const ByteSource& source) {
  constexpr uint64_t kMostBytes = uint64_t{16} << 20;
  constexpr std::array<std::byte, kRecordHeaderBytes> kDataEnd = {std::byte{0x0f}, std::byte{4}};
  const auto end = ReadFooter(source);
  if (!end) return end.error();
  const uint64_t begin = end->offset - std::min(end->offset, kMostBytes);
  Buffer tail(static_cast<size_t>(end->offset - begin));
  if (const auto read = source.Read(begin, tail); !read) return read.error();
  for (auto from = tail.begin(); end->footer.summary_crc != 0;) {
    from = std::search(from, tail.end(), kDataEnd.begin(), kDataEnd.end());
    if (from == tail.end()) break;
    const uint64_t start = begin + static_cast<uint64_t>(from - tail.begin()) + kDataEnd.size() + 4;
    auto summary = start <= end->offset ? ReadSummaryFrom(source, start, *end) : At(start, "none");
    if (summary.ok()) return summary;
    ++from;
  }
  return Error{ErrorCode::kNotFound, "no summary is where the log's end has its checksum of"};
}

namespace {

/// Messages that the chunks' message indexes name, from their sizes: 16 bytes a message, after the record's
/// header, the channel and the length of the list. Nullopt: a chunk has no message indexes.
std::optional<uint64_t> IndexedMessages(const std::vector<ChunkIndex>& chunks) {
  constexpr uint64_t kMessageBytes = 16;
  constexpr uint64_t kIndexBytes = kRecordHeaderBytes + sizeof(uint16_t) + sizeof(uint32_t);
  uint64_t messages = 0;
  for (const ChunkIndex& chunk : chunks) {
    const uint64_t around = chunk.message_index_offsets.size() * kIndexBytes;
    if (chunk.message_index_length <= around) return std::nullopt;
    messages += (chunk.message_index_length - around) / kMessageBytes;
  }
  return messages;
}

}  // namespace

std::string Incomplete(const Summary& summary) {
  if (!summary.statistics) return "the summary has no statistics";
  const Statistics& statistics = *summary.statistics;
  if (statistics.chunk_count != summary.chunk_indexes.size()) return "the summary lacks chunk indexes";
  if (IndexedMessages(summary.chunk_indexes).value_or(UINT64_MAX) < statistics.message_count)
    return "the summary's indexes lack messages, as of those that are not in chunks";
  if (statistics.channel_message_counts.empty() && statistics.message_count != 0)
    return "the statistics lack the numbers of messages by channel";
  if (statistics.attachment_count != summary.attachment_indexes.size())
    return "the summary lacks attachment indexes";
  if (statistics.metadata_count != summary.metadata_indexes.size())
    return "the summary lacks metadata indexes";
  if (statistics.channel_count != summary.channels.size()) return "the summary lacks channels";
  const auto known = [&](const auto& entry) { return summary.channels.contains(entry.first); };
  for (const ChunkIndex& index : summary.chunk_indexes) {
    if (!std::ranges::all_of(index.message_index_offsets, known)) return "the summary lacks channels";
  }
  return {};
}

}  // namespace taclink::mcap
