#include <algorithm>
#include <set>

#include "mcap/checker.h"

namespace taclink::mcap {
namespace {

std::string Numbers(const char* what, uint64_t stated, uint64_t found) {
  return std::string(what) + ": the statistics say " + std::to_string(stated) + ", there are " +
         std::to_string(found);
}

uint64_t OffsetOf(const AttachmentIndex& index) {
  return index.offset;
}
uint64_t OffsetOf(const MetadataIndex& index) {
  return index.offset;
}
uint64_t OffsetOf(const ChunkIndex& index) {
  return index.chunk_start;
}

/// How many ids are in either.
template <typename T>
size_t Union(const std::map<uint16_t, T>& a, const std::map<uint16_t, T>& b) {
  return a.size() +
         static_cast<size_t>(std::ranges::count_if(b, [&](const auto& e) { return !a.contains(e.first); }));
}

}  // namespace

void Checker::VisitSummary(const RawRecord& record, uint64_t length) {
  if (record.opcode == Opcode::kSummaryOffset) {
    if (!summary_offset_start_) summary_offset_start_ = offset_;
    if (auto group = Decoded<SummaryOffset>(offset_, record.content)) told_groups_.push_back(*group);
    return;
  }
  if (summary_offset_start_) Wrong(offset_, NameOf(record.opcode) + " after the summary offsets");
  NoteGroup(record.opcode, length);
  switch (record.opcode) {
    case Opcode::kSchema:
    case Opcode::kChannel:
      return VisitSummaryCopy(record);
    case Opcode::kStatistics:
      if (told_.statistics) Doubt(offset_, "a second Statistics");
      told_.statistics = Decoded<Statistics>(offset_, record.content);
      statistics_offset_ = offset_;
      return;
    case Opcode::kChunkIndex:
      if (auto index = Decoded<ChunkIndex>(offset_, record.content)) {
        told_.chunk_indexes.push_back(std::move(*index));
      }
      return;
    case Opcode::kAttachmentIndex:
      if (auto index = Decoded<AttachmentIndex>(offset_, record.content)) {
        told_.attachment_indexes.push_back(std::move(*index));
      }
      return;
    case Opcode::kMetadataIndex:
      if (auto index = Decoded<MetadataIndex>(offset_, record.content)) {
        told_.metadata_indexes.push_back(std::move(*index));
      }
      return;
    default:
      Wrong(offset_, NameOf(record.opcode) + " in the summary section");
  }
}

void Checker::NoteGroup(Opcode opcode, uint64_t length) {
  if (!groups_.empty() && groups_.back().group_opcode == opcode) {
    groups_.back().group_length += length;
    return;
  }
  if (std::ranges::find(groups_, opcode, &SummaryOffset::group_opcode) != groups_.end()) {
    Wrong(offset_, NameOf(opcode) + " apart from the others of its type in the summary");
  }
  groups_.push_back({.group_opcode = opcode, .group_start = offset_, .group_length = length});
}

void Checker::VisitSummaryCopy(const RawRecord& record) {
  const auto compare = [&](const auto& copy, const auto& found, auto& told) {
    const auto original = found.find(copy.id);
    if (original == found.end()) {
      Doubt(offset_, NameOf(record.opcode) + " in the summary that the data section does not have");
    } else if (!(original->second == copy)) {
      Wrong(offset_, NameOf(record.opcode) + " in the summary differs from that in the data section");
    }
    told.insert_or_assign(copy.id, copy);
  };
  if (record.opcode == Opcode::kSchema) {
    if (const auto schema = Decoded<Schema>(offset_, record.content)) {
      if (schema->id == 0) Wrong(offset_, "a schema with the id 0");
      compare(*schema, found_.schemas, told_.schemas);
    }
  } else if (const auto channel = Decoded<Channel>(offset_, record.content)) {
    compare(*channel, found_.channels, told_.channels);
    if (told_.statistics) Doubt(offset_, "a channel after the statistics");
  }
}

void Checker::CheckStatistics() {
  if (!told_.statistics) return;
  const Statistics& told = *told_.statistics;
  const Statistics& found = *found_.statistics;
  const auto compare = [&](const char* what, uint64_t a, uint64_t b) {
    if (a != b) Wrong(statistics_offset_, Numbers(what, a, b));
  };
  compare("messages", told.message_count, found.message_count);
  compare("schemas", told.schema_count, Union(found_.schemas, told_.schemas));
  compare("channels", told.channel_count, Union(found_.channels, told_.channels));
  compare("attachments", told.attachment_count, found.attachment_count);
  compare("metadata records", told.metadata_count, found.metadata_count);
  compare("chunks", told.chunk_count, found.chunk_count);
  compare("first log time", told.message_start_ns, found.message_start_ns);
  compare("last log time", told.message_end_ns, found.message_end_ns);
  if (told.channel_message_counts.empty()) return;
  for (const auto& [id, count] : found.channel_message_counts) {
    const auto entry = told.channel_message_counts.find(id);
    compare("messages of a channel", entry == told.channel_message_counts.end() ? 0 : entry->second, count);
  }
  for (const auto& [id, count] : told.channel_message_counts) {
    if (!found.channel_message_counts.contains(id)) compare("messages of a channel", count, 0);
    if (!told_.channels.contains(id)) Wrong(statistics_offset_, "a counted channel is not in the summary");
  }
}

template <typename T>
void Checker::CheckIndexes(const std::vector<T>& told, const std::vector<T>& found, const char* what) {
  if (told.empty()) {
    if (!found.empty()) Doubt(summary_start_, std::string("the summary has no ") + what + " indexes");
    return;
  }
  std::map<uint64_t, const T*> by_offset;
  for (const T& index : found) by_offset[OffsetOf(index)] = &index;
  for (const T& index : told) {
    const auto entry = by_offset.find(OffsetOf(index));
    if (entry == by_offset.end()) {
      Wrong(summary_start_, std::string("an index of a ") + what + " at " + std::to_string(OffsetOf(index)) +
                                ", where none is, or a second one");
      continue;
    }
    if (!(index == *entry->second)) {
      Wrong(OffsetOf(index), std::string("the index of this ") + what + " disagrees with it");
    }
    by_offset.erase(entry);
  }
  for (const auto& [offset, index] : by_offset) Wrong(offset, std::string("no index of this ") + what);
}

void Checker::CheckChunkIndexes() {
  std::vector<ChunkIndex> told = told_.chunk_indexes;
  std::vector<ChunkIndex> found = found_.chunk_indexes;
  // Without its map an index says that there are no message indexes: that is allowed.
  std::map<uint64_t, ChunkIndex*> by_offset;
  for (ChunkIndex& index : found) by_offset[index.chunk_start] = &index;
  for (ChunkIndex& index : told) {
    const auto entry = by_offset.find(index.chunk_start);
    if (entry == by_offset.end()) continue;
    const ChannelMap& offsets = entry->second->message_index_offsets;
    if (index.message_index_offsets.empty() && !offsets.empty()) {
      Doubt(index.chunk_start, "the index of this chunk does not name its message indexes");
      index.message_index_offsets = offsets;
    }
  }
  CheckIndexes(told, found, "chunk");
  std::set<uint16_t> named;  // by the chunk indexes: only these must be there
  for (const ChunkIndex& index : told_.chunk_indexes) {
    for (const auto& [id, offset] : index.message_index_offsets) named.insert(id);
  }
  for (const auto& [id, count] : found_.statistics->channel_message_counts) {
    if (told.empty() || told_.channels.contains(id)) continue;
    const std::string what = "the summary lacks channel " + std::to_string(id);
    if (named.contains(id)) {
      Wrong(summary_start_, what + ", which a chunk index names");
    } else {
      Doubt(summary_start_, what + ", which is in a chunk");
    }
  }
  for (const auto& [id, channel] : told_.channels) {
    if (!told.empty() && channel.schema_id != 0 && !told_.schemas.contains(channel.schema_id)) {
      Wrong(summary_start_, "the summary lacks schema " + std::to_string(channel.schema_id));
    }
  }
  if (!told.empty() && loose_messages_ != 0) {
    Doubt(summary_start_,
          std::to_string(loose_messages_) + " messages are outside of chunks, where no index finds them");
  }
}

void Checker::CheckSummaryOffsets() {
  for (const SummaryOffset& told : told_groups_) {
    if (std::ranges::find(groups_, told) == groups_.end()) {
      Wrong(*summary_offset_start_, "the summary offset of " + NameOf(told.group_opcode) + " is wrong");
    }
  }
  if (!told_groups_.empty() && told_groups_.size() < groups_.size()) {
    Doubt(*summary_offset_start_, "summary offsets of some groups are missing");
  }
}

void Checker::CheckSummary() {
  if (!in_summary_ || (groups_.empty() && told_groups_.empty())) {
    return Doubt(offset_, "the log has no summary: readers must search all of it");
  }
  CheckStatistics();
  CheckChunkIndexes();
  CheckIndexes(told_.attachment_indexes, found_.attachment_indexes, "attachment");
  CheckIndexes(told_.metadata_indexes, found_.metadata_indexes, "metadata record");
  CheckSummaryOffsets();
}

}  // namespace taclink::mcap
