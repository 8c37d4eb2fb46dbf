#include "mcap/scan.h"

#include <algorithm>
#include <string>

#include "mcap/scanner.h"

namespace taclink::mcap {

Result<ScanReport> Scan(const ByteSource& source, ScanVisitor& visitor, const ScanOptions& options) {
  return Scanner(source, visitor, options).Run();
}

std::string ScanReport::Text() const {
  const auto count = [](uint64_t n, const std::string& what) {
    return ", " + std::to_string(n) + " " + what;
  };
  std::string text = std::to_string(messages) + " messages";
  text += count(attachments, "attachments") + count(metadata, "metadata records");
  if (lost_bytes != 0)
    text += count(lost_bytes, "bytes lost") + " in" + count(lost.size(), "places").substr(1);
  if (damaged_chunks != 0) text += count(damaged_chunks, "damaged chunks");
  if (salvaged_chunks != 0) text += count(salvaged_chunks, "chunks saved from damage");
  if (damaged_attachments != 0) text += count(damaged_attachments, "damaged attachments");
  if (dropped != 0) text += count(dropped, "messages dropped that can't be verified");
  if (orphans != 0) text += count(orphans, "messages dropped whose channel is lost");
  if (recorded_messages && *recorded_messages != messages) text += count(*recorded_messages, "were recorded");
  if (start_missing) text += ", the start is missing";
  if (end_missing) text += ", the end is missing";
  return text;
}

Scanner::Scanner(const ByteSource& source, ScanVisitor& visitor, const ScanOptions& options)
    : source_(source), visitor_(visitor), options_(options), resync_(source), look_(source) {}

Result<ScanReport> Scanner::Run() {
  const auto footer = ReadFooter(source_);
  if (footer.ok() && footer->footer.summary_crc != 0) {
    auto summary = ReadSummarySection(source_, options_.limits);
    if (!summary) summary = FindMovedSummary(source_);
    if (summary.ok()) summary_ = std::move(*summary);
  }
  if (summary_ && summary_->statistics) report_.recorded_messages = summary_->statistics->message_count;
  has_chunks_ = summary_ && !summary_->chunk_indexes.empty();

  report_.start_missing = !resync_.IsMagic(0) || resync_.HeaderAt(kMagic.size()).opcode != Opcode::kHeader;
  report_.end_missing = !footer.ok();
  while (offset_ < source_.size()) {
    if (resync_.IsMagic(offset_)) {
      offset_ += kMagic.size();
    } else if (const auto stepped = Step(); !stepped) {
      return stepped.error();
    }
  }
  return std::move(report_);
}

Result<void> Scanner::Told(Result<void> result) {
  if (!result) told_wrong_ = result.error();
  return result;
}

void Scanner::SkipDamage(uint64_t from, uint64_t to, const std::string& why) {
  constexpr size_t kMostRanges = 1000;
  report_.lost_bytes += to - from;
  const bool follows =
      !report_.lost.empty() && report_.lost.back().offset + report_.lost.back().length == from;
  if (follows) {
    report_.lost.back().length += to - from;
  } else if (report_.lost.size() < kMostRanges) {
    report_.lost.push_back({.offset = from, .length = to - from, .why = why});
  }
}

void Scanner::EnterRun(uint64_t offset) {
  const uint64_t end = resync_.RunEnd(offset);
  const RecordHeader next = resync_.HeaderAt(end);
  const bool before_index = next.length != kNoRecord && next.opcode == Opcode::kMessageIndex;
  if (end > offset && (has_chunks_ || before_index)) doubtful_until_ = end;
}

Result<void> Scanner::Step() {
  const RecordHeader header = resync_.HeaderAt(offset_);
  if (header.length == kNoRecord) {
    if (const auto spared = TakeSparedChunk(); !spared || *spared)
      return spared ? Result<void>() : spared.error();
    const uint64_t begin = offset_, next = resync_.Find(begin + 1);
    EnterRun(next);
    offset_ = next;
    return TakeDamage(begin, "no record begins here");
  }
  const uint64_t end = offset_ + kRecordHeaderBytes + header.length;
  const uint64_t next = resync_.CanGoOn(end) ? end : resync_.Find(offset_ + 1);
  const Place place{.offset = offset_, .end = end, .next = next, .doubtful = offset_ < doubtful_until_};
  const auto taken = TakeRecordAt(place, header.opcode);
  if (taken.ok()) {
    offset_ = end;
    return {};
  }
  if (told_wrong_) return *told_wrong_;
  if (taken.error().code == ErrorCode::kUnavailable) return taken.error();
  if (const auto spared = TakeSparedChunk(); !spared || *spared)
    return spared ? Result<void>() : spared.error();
  // Where the length is right, what follows is searched from there, if need be, by the next step.
  offset_ = std::min({place.next, place.end, resume_.value_or(place.end)});
  resume_.reset();
  if (offset_ < end) EnterRun(offset_);
  // An attachment may be a log itself, whose messages are none of this one.
  if (header.opcode == Opcode::kAttachment && place.length_is_right()) {
    SkipDamage(place.offset, offset_, taken.error().message);
    return {};
  }
  return TakeDamage(place.offset, taken.error().message);
}

Result<void> Scanner::TakeRecordAt(const Place& place, Opcode opcode) {
  if (!IsKnown(opcode)) {
    if (!place.length_is_right()) return At(place.offset, "no record begins here");
    if (const auto hides = HidesChunk(place); !hides) return hides;
    ++report_.unknown_records;
    return {};
  }
  const auto record = ReadRecord(source_, place.offset, options_.limits, record_);
  if (!record) return record.error();
  return Take(place, *record);
}

Result<void> Scanner::Take(const Place& place, const RawRecord& record) {
  switch (record.opcode) {
    case Opcode::kSchema:
    case Opcode::kChannel:
      return TakeDefinition(place, record);
    case Opcode::kMessage:
      return TakeTopMessage(place, record.content);
    case Opcode::kChunk:
      return TakeChunk(place, record.content);
    case Opcode::kAttachment:
      return TakeAttachment(place, record.content);
    case Opcode::kMetadata:
      return TakeMetadata(place, record.content);
    default:
      break;
  }
  if (!place.length_is_right()) return At(place.offset, "a damaged " + NameOf(record.opcode));
  if (const auto hides = HidesChunk(place); !hides) return hides;
  if (record.opcode == Opcode::kDataEnd)
    data_ended_ = record.content.size() == sizeof(DataEnd::data_section_crc);
  if (record.opcode != Opcode::kHeader) return {};
  data_ended_ = false;
  const auto header = Decode<Header>(record.content);
  if (!header) return At(place.offset, header.error());
  if (const auto fits = CheckLength(place, *header); !fits) return fits;
  return Told(visitor_.OnHeader(*header));
}

template <typename T>
Result<void> Scanner::CheckLength(const Place& place, const T& record) {
  Buffer encoded;
  Append(record, encoded);
  const uint64_t end = place.offset + encoded.size();
  if (end >= place.end || !resync_.IsStart(end)) return {};
  resume_ = end;
  return At(place.offset, "a record of a wrong length");
}

Result<void> Scanner::TakeDefinition(const Place& place, const RawRecord& record) {
  if (!place.length_is_right()) return At(place.offset, "a damaged " + NameOf(record.opcode));
  if (place.doubtful && !options_.keep_unverified) return {};
  if (record.opcode == Opcode::kSchema) {
    const auto schema = Decode<Schema>(record.content);
    if (!schema) return At(place.offset, schema.error());
    const auto fits = CheckLength(place, *schema);
    return fits ? TakeSchema(*schema) : fits;
  }
  const auto channel = Decode<Channel>(record.content);
  if (!channel) return At(place.offset, channel.error());
  const auto fits = CheckLength(place, *channel);
  return fits ? TakeChannel(*channel) : fits;
}

namespace {

/// Whether a record's content is exactly that of a message index: one wrong bit makes its type a message's.
bool IsMessageIndex(Bytes content) {
  ByteReader in(content);
  (void)in.Number<uint16_t>();
  const auto entries_size = in.Number<uint32_t>();
  return entries_size == in.remaining() && entries_size % 16 == 0;
}

}  // namespace

Result<void> Scanner::TakeTopMessage(const Place& place, Bytes content) {
  if (!place.length_is_right()) return At(place.offset, "a damaged Message");
  if (data_ended_) return At(place.offset, "a message in the summary");
  const bool in_doubt = (place.doubtful || has_chunks_) && !options_.is_intact;
  if (has_chunks_ && in_doubt && IsMessageIndex(content)) return At(place.offset, "a damaged MessageIndex");
  // In a log with chunks hardly a message lies outside, but one wrong bit makes one of other records.
  if (in_doubt && !options_.keep_unverified) {
    ++report_.dropped;
    return At(place.offset, "a message outside of chunks: what is left of one, or no message");
  }
  const auto message = Decode<Message>(content);
  if (!message) return At(place.offset, message.error());
  const auto taken = TakeMessage(*message, {.offset = place.offset, .length = place.end - place.offset});
  if (!taken) return taken.error();
  return *taken ? Result<void>() : At(place.offset, "a message whose channel is lost");
}

Result<void> Scanner::TakeAttachment(const Place& place, Bytes content) {
  const auto attachment = Decode<Attachment>(content);
  if (!attachment || !CrcAgrees(*attachment, content)) {
    ++report_.damaged_attachments;
    return At(place.offset, "a damaged Attachment");
  }
  if (attachment->crc == 0 && !place.length_is_right()) return At(place.offset, "a damaged Attachment");
  ++report_.attachments;
  return Told(visitor_.OnAttachment(*attachment, {.offset = place.offset,
                                                  .length = place.end - place.offset,
                                                  .log_time_ns = attachment->log_time_ns,
                                                  .create_time_ns = attachment->create_time_ns,
                                                  .data_size = attachment->data.size(),
                                                  .name = attachment->name,
                                                  .media_type = attachment->media_type}));
}

Result<void> Scanner::TakeMetadata(const Place& place, Bytes content) {
  if (!place.length_is_right()) return At(place.offset, "a damaged Metadata");
  const auto metadata = Decode<Metadata>(content);
  if (!metadata) return At(place.offset, metadata.error());
  if (const auto fits = CheckLength(place, *metadata); !fits) return fits;
  ++report_.metadata;
  return Told(visitor_.OnMetadata(
      *metadata, {.offset = place.offset, .length = place.end - place.offset, .name = metadata->name}));
}

}  // namespace taclink::mcap
