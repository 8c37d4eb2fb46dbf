#include "mcap/reader.h"

#include <algorithm>
#include <array>

#include "mcap/check.h"

namespace taclink::mcap {

/// Makes a summary and the blocks of what a scan finds.
class IndexingVisitor : public ScanVisitor {
 public:
  explicit IndexingVisitor(Reader& reader)
      : reader_(reader), statistics_(reader.summary_.statistics.emplace()) {}

  Result<void> OnHeader(const Header& header) override {
    reader_.summary_.header = header;
    return {};
  }
  Result<void> OnSchema(const Schema& schema) override {
    return AddOnce(reader_.summary_.schemas, schema, "schema");
  }
  Result<void> OnChannel(const Channel& channel) override {
    return AddOnce(reader_.summary_.channels, channel, "channel");
  }
  Result<void> OnMessage(const Message& message, const MessagePlace& place) override {
    const uint64_t time = message.log_time_ns;
    const bool first = statistics_.message_count == 0;
    statistics_.message_start_ns = first ? time : std::min(statistics_.message_start_ns, time);
    statistics_.message_end_ns = std::max(statistics_.message_end_ns, time);
    ++statistics_.message_count;
    ++statistics_.channel_message_counts[message.channel_id];
    if (!place.in_chunk) AddLoose(message, place);
    return {};
  }
  Result<void> OnAttachment(const Attachment& /*attachment*/, const AttachmentIndex& index) override {
    reader_.summary_.attachment_indexes.push_back(index);
    return {};
  }
  Result<void> OnMetadata(const Metadata& /*metadata*/, const MetadataIndex& index) override {
    reader_.summary_.metadata_indexes.push_back(index);
    return {};
  }
  Result<void> OnChunk(const ChunkIndex& index) override {
    reader_.summary_.chunk_indexes.push_back(index);
    reader_.blocks_.push_back({.offset = index.chunk_start,
                               .length = index.chunk_length,
                               .start_ns = index.message_start_ns,
                               .end_ns = index.message_end_ns});
    return {};
  }

  void Finish() {
    const Summary& found = reader_.summary_;
    statistics_.schema_count = static_cast<uint16_t>(found.schemas.size());
    statistics_.channel_count = static_cast<uint32_t>(found.channels.size());
    statistics_.attachment_count = static_cast<uint32_t>(found.attachment_indexes.size());
    statistics_.metadata_count = static_cast<uint32_t>(found.metadata_indexes.size());
    statistics_.chunk_count = static_cast<uint32_t>(found.chunk_indexes.size());
  }

 private:
  template <typename T>
  Result<void> AddOnce(std::map<uint16_t, T>& all, const T& record, const char* what) {
    if (all.emplace(record.id, record).second) return {};
    return Error{ErrorCode::kInvalidArgument, std::string(what) + " " + std::to_string(record.id) +
                                                  " changes its meaning midway: recover the log first"};
  }

  void AddLoose(const Message& message, const MessagePlace& place) {
    constexpr uint64_t kMostBytes = 1 << 20;
    std::vector<MessageBlock>& blocks = reader_.blocks_;
    const bool joins = !blocks.empty() && !blocks.back().is_chunk &&
                       blocks.back().offset + blocks.back().length == place.offset &&
                       blocks.back().length < kMostBytes;
    if (!joins) {
      blocks.push_back({.offset = place.offset,
                        .length = 0,
                        .start_ns = message.log_time_ns,
                        .end_ns = message.log_time_ns,
                        .is_chunk = false});
    }
    MessageBlock& block = blocks.back();
    block.length += place.length;
    block.start_ns = std::min(block.start_ns, message.log_time_ns);
    block.end_ns = std::max(block.end_ns, message.log_time_ns);
  }

  Reader& reader_;
  Statistics& statistics_;
};

namespace {

/// Of a log whose summary can't be used, for `why`: what is damaged. Empty: nothing, it only lacks indexes.
std::string DamageOf(const ByteSource& source, const Limits& limits, const std::string& why) {
  if (!ReadFooter(source)) return why;  // not closed, or cut off: Check would say no more
  const auto report = Check(source, limits);
  if (!report) return report.error().message;
  if (report->ok()) return {};
  const auto first = std::ranges::find(report->findings, Severity::kError, &Finding::severity);
  if (first == report->findings.end()) return why;
  return At(first->offset, first->what).message;
}

}  // namespace

Result<std::unique_ptr<Reader>> Reader::Open(std::shared_ptr<const ByteSource> source, Limits limits) {
  std::array<std::byte, kMagic.size()> start{};
  if (source->size() < start.size())
    return Error{ErrorCode::kInvalidArgument, "not an MCAP log: it is too short"};
  if (const auto read = source->Read(0, start); !read) return read.error();
  if (start != kMagic) {
    return Error{ErrorCode::kInvalidArgument, "not an MCAP log of version 0: it has other magic bytes"};
  }
  std::unique_ptr<Reader> reader(new Reader(std::move(source), limits));
  auto summary = ReadSummary(*reader->source_, limits);
  const std::string why = summary.ok() ? Incomplete(*summary) : summary.error().message;
  if (why.empty()) {
    reader->UseSummary(std::move(*summary));
    return reader;
  }
  reader->summary_problem_ = DamageOf(*reader->source_, limits, why);
  if (const auto scanned = reader->UseScan(reader->summary_problem_.empty()); !scanned)
    return scanned.error();
  return reader;
}

void Reader::UseSummary(Summary summary) {
  summary_ = std::move(summary);
  blocks_.reserve(summary_.chunk_indexes.size());
  for (const ChunkIndex& index : summary_.chunk_indexes) {
    blocks_.push_back({.offset = index.chunk_start,
                       .length = index.chunk_length,
                       .start_ns = index.message_start_ns,
                       .end_ns = index.message_end_ns});
  }
}

Result<void> Reader::UseScan(bool is_intact) {
  IndexingVisitor visitor(*this);
  auto report = Scan(*source_, visitor, {.limits = limits_, .is_intact = is_intact});
  if (!report) return report.error();
  visitor.Finish();
  scan_ = std::move(*report);
  return {};
}

Result<Attachment> Reader::ReadAttachment(const AttachmentIndex& index, Buffer& buffer) const {
  auto attachment = ReadRecordAs<Attachment>(*source_, Opcode::kAttachment, index.offset, limits_, buffer);
  if (!attachment) return attachment;
  if (!CrcAgrees(*attachment, buffer)) {
    return At(index.offset, "the CRC of attachment '" + attachment->name + "' is wrong: it is damaged");
  }
  return attachment;
}

Result<Metadata> Reader::ReadMetadata(const MetadataIndex& index) const {
  Buffer buffer;
  return ReadRecordAs<Metadata>(*source_, Opcode::kMetadata, index.offset, limits_, buffer);
}

}  // namespace taclink::mcap
