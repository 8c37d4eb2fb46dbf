#include "tests/mcap/log_content.h"

#include <random>
#include <ranges>

#include "mcap/summary_writer.h"

namespace taclink::mcap::testing {
namespace {

constexpr uint64_t kStartNs = 1'700'000'000'000'000'000;

class RandomWriter {
 public:
  RandomWriter(const RandomLog& log, ByteSink& sink) : log_(log), random_(log.seed) {
    writer_ = std::move(*Writer::Create(sink, log.options));
    content_.profile = log.options.profile;
  }

  LogContent Run() {
    AddChannels();
    for (size_t i = 0; i < log_.messages; ++i) {
      if (Below(40) == 0) AddAttachment();
      if (Below(40) == 0) AddMetadata();
      if (Below(60) == 0) (void)writer_->Flush();
      AddMessage();
    }
    (void)writer_->Close();
    return content_;
  }

 private:
  uint32_t Below(uint32_t end) { return static_cast<uint32_t>(random_() % end); }

  std::string RandomText(size_t size) {
    std::string text(size, '\0');
    const uint32_t variety = 1 + Below(255);
    for (char& c : text) c = static_cast<char>(Below(variety));
    return text;
  }

  void AddChannels() {
    const uint16_t schema = *writer_->AddSchema(
        {.name = "taclink.v1.LinkFrame", .encoding = "protobuf", .data = RandomText(300)});
    const uint32_t channels = 1 + Below(5);
    for (uint32_t i = 0; i < channels; ++i) {
      const bool typed = Below(2) == 0;
      const std::string topic = "/link" + std::to_string(i);
      ids_.push_back(*writer_->AddChannel({.schema_id = typed ? schema : uint16_t{0},
                                           .topic = topic,
                                           .message_encoding = typed ? "protobuf" : "",
                                           .metadata = {{"index", std::to_string(i)}}}));
      topics_.push_back(topic);
      schemas_.push_back(typed ? "taclink.v1.LinkFrame" : "");
    }
  }

  void AddMessage() {
    const size_t channel = Below(static_cast<uint32_t>(ids_.size()));
    now_ns_ += Below(4) == 0 ? 0 : 1'000'000;
    const uint64_t time = now_ns_ - (Below(5) == 0 ? Below(30'000'000) : 0);
    const auto data =
        std::make_shared<const std::string>(RandomText(Below(20) == 0 ? Below(20000) : Below(200)));
    content_.messages.push_back({.topic = topics_[channel],
                                 .schema = schemas_[channel],
                                 .sequence = ++sequence_,
                                 .log_time_ns = time,
                                 .publish_time_ns = time - Below(1000),
                                 .data = *data});
    const StoredMessage& stored = content_.messages.back();
    const Message message{.channel_id = ids_[channel],
                          .sequence = stored.sequence,
                          .log_time_ns = stored.log_time_ns,
                          .publish_time_ns = stored.publish_time_ns,
                          .data = AsBytes(*data)};
    (void)(Below(2) == 0 ? writer_->Write(message) : writer_->Write(message, data));
  }

  void AddAttachment() {
    const StoredAttachment stored{.log_time_ns = now_ns_,
                                  .create_time_ns = Below(2) * now_ns_,
                                  .name = "model" + std::to_string(Below(9)) + ".yaml",
                                  .media_type = "application/yaml",
                                  .data = RandomText(Below(3000))};
    (void)writer_->AddAttachment({.log_time_ns = stored.log_time_ns,
                                  .create_time_ns = stored.create_time_ns,
                                  .name = stored.name,
                                  .media_type = stored.media_type,
                                  .data = AsBytes(stored.data)});
    content_.attachments.push_back(stored);
  }

  void AddMetadata() {
    const Metadata metadata{.name = "robot" + std::to_string(Below(9)),
                            .metadata = {{"serial", std::to_string(Below(1000))}, {"empty", ""}}};
    (void)writer_->AddMetadata(metadata);
    content_.metadata.push_back(metadata);
  }

  const RandomLog& log_;
  std::mt19937_64 random_;
  std::unique_ptr<Writer> writer_;
  std::vector<uint16_t> ids_;
  std::vector<std::string> topics_;
  std::vector<std::string> schemas_;
  uint64_t now_ns_ = kStartNs;
  uint32_t sequence_ = 0;
  LogContent content_;
};

StoredMessage Store(const Message& message, const Channel& channel,
                    const std::map<uint16_t, Schema>& schemas) {
  const auto schema = schemas.find(channel.schema_id);
  return {.topic = channel.topic,
          .schema = schema == schemas.end() ? "" : schema->second.name,
          .sequence = message.sequence,
          .log_time_ns = message.log_time_ns,
          .publish_time_ns = message.publish_time_ns,
          .data = Text(message.data)};
}

StoredAttachment Store(const Attachment& attachment) {
  return {.log_time_ns = attachment.log_time_ns,
          .create_time_ns = attachment.create_time_ns,
          .name = attachment.name,
          .media_type = attachment.media_type,
          .data = Text(attachment.data)};
}

Result<LogContent> ReadContent(Bytes bytes, MessageOrder order) {
  auto reader = Reader::Open(std::make_shared<MemorySource>(bytes));
  if (!reader) return reader.error();
  LogContent content;
  content.profile = (*reader)->header().profile;
  MessageCursor cursor(**reader, {.order = order});
  auto message = cursor.Next();
  for (; message.ok(); message = cursor.Next()) {
    const Channel& channel = (*reader)->channels().at(message->channel_id);
    content.messages.push_back(Store(*message, channel, (*reader)->schemas()));
  }
  if (message.error().code != ErrorCode::kEndOfData) return message.error();
  Buffer buffer;
  for (const AttachmentIndex& index : (*reader)->attachments()) {
    const auto attachment = (*reader)->ReadAttachment(index, buffer);
    if (!attachment) return attachment.error();
    content.attachments.push_back(Store(*attachment));
  }
  for (const MetadataIndex& index : (*reader)->metadata()) {
    const auto metadata = (*reader)->ReadMetadata(index);
    if (!metadata) return metadata.error();
    content.metadata.push_back(*metadata);
  }
  return content;
}

}  // namespace

std::string Text(Bytes bytes) {
  return std::string(AsText(bytes));
}

LogContent RandomLog::WriteTo(ByteSink& sink) const {
  return RandomWriter(*this, sink).Run();
}

Buffer RandomLogBytes(const RandomLog& log, LogContent* content) {
  BufferSink sink;
  LogContent written = log.WriteTo(sink);
  if (content != nullptr) *content = std::move(written);
  return sink.bytes();
}

Buffer SmallLog(Compression compression) {
  BufferSink sink;
  const auto writer =
      std::move(*Writer::Create(sink, {.profile = "p", .library = "l", .compression = compression}));
  const uint16_t schema = *writer->AddSchema({.name = "S", .encoding = "e", .data = "d"});
  const uint16_t one = *writer->AddChannel({.schema_id = schema, .topic = "a", .metadata = {{"k", "v"}}});
  const uint16_t two = *writer->AddChannel({.topic = "b", .message_encoding = "m"});
  (void)writer->Write(
      {.channel_id = one, .sequence = 1, .log_time_ns = 5, .publish_time_ns = 4, .data = AsBytes("x")});
  (void)writer->Write(
      {.channel_id = two, .sequence = 1, .log_time_ns = 3, .data = AsBytes("yyyyyyyyyyyyyyyyyyyyyyyy")});
  (void)writer->Flush();
  (void)writer->AddAttachment({.log_time_ns = 1, .name = "n", .media_type = "t", .data = AsBytes("file")});
  (void)writer->AddMetadata({.name = "m", .metadata = {{"a", "b"}}});
  (void)writer->Write(
      {.channel_id = one, .sequence = 2, .log_time_ns = 4, .publish_time_ns = 2, .data = AsBytes("z")});
  (void)writer->Close();
  return sink.bytes();
}

Buffer AsOthersWrite(Bytes log, ForeignForm form) {
  const auto reader = std::move(*Reader::Open(std::make_shared<MemorySource>(log)));
  const bool no_summary = form == ForeignForm::kNoSummary || form == ForeignForm::kNoChunksNoSummary;
  size_t kept = reader->chunk_indexes().size();
  if (form == ForeignForm::kNoChunks || form == ForeignForm::kNoChunksNoSummary) kept = 0;
  if (form == ForeignForm::kLastChunkInPieces) --kept;
  Buffer out(kMagic.begin(), kMagic.end()), loaded;
  size_t chunks = 0;
  for (Bytes rest = log.subspan(kMagic.size());;) {
    const Bytes before = rest;
    const RawRecord record = *TakeRecord(rest);
    if (record.opcode == Opcode::kDataEnd) break;
    if (record.opcode == Opcode::kChunk) ++chunks;
    if (record.opcode == Opcode::kMessageIndex && chunks > kept) continue;
    if (record.opcode == Opcode::kChunk && chunks > kept) {
      AppendBytes(*LoadChunk(*Decode<Chunk>(record.content), {}, loaded), out);
    } else {
      AppendBytes(before.first(before.size() - rest.size()), out);
    }
  }
  Append(DataEnd{}, out);
  SummaryWriter summary(0, true, out);
  if (!no_summary) {
    Statistics statistics = reader->statistics();
    statistics.chunk_count = static_cast<uint32_t>(kept);
    std::vector<ChunkIndex> indexes(reader->chunk_indexes().begin(),
                                    reader->chunk_indexes().begin() + static_cast<ptrdiff_t>(kept));
    if (form == ForeignForm::kNoChannelsInSummary) {
      statistics.channel_message_counts.clear();
      for (ChunkIndex& index : indexes) index.message_index_offsets.clear();
    } else {
      summary.Add(Opcode::kSchema, reader->schemas() | std::views::values);
      summary.Add(Opcode::kChannel, reader->channels() | std::views::values);
    }
    if (form != ForeignForm::kNoStatistics) summary.Add(Opcode::kStatistics, std::span(&statistics, 1));
    if (form != ForeignForm::kNoChunkIndexes) summary.Add(Opcode::kChunkIndex, std::span(indexes));
  }
  summary.Finish();
  return out;
}

LogContent ReadAll(Bytes bytes, std::string* error, MessageOrder order) {
  auto content = ReadContent(bytes, order);
  *error = content.ok() ? "" : content.error().message;
  return content.ok() ? std::move(*content) : LogContent();
}

Result<void> CollectingVisitor::OnHeader(const Header& header) {
  content.profile = header.profile;
  return {};
}

Result<void> CollectingVisitor::OnSchema(const Schema& schema) {
  schemas_[schema.id] = schema;
  return {};
}

Result<void> CollectingVisitor::OnChannel(const Channel& channel) {
  channels_[channel.id] = channel;
  return {};
}

Result<void> CollectingVisitor::OnMessage(const Message& message, const MessagePlace& /*place*/) {
  content.messages.push_back(Store(message, channels_.at(message.channel_id), schemas_));
  return {};
}

Result<void> CollectingVisitor::OnAttachment(const Attachment& attachment, const AttachmentIndex& /*index*/) {
  content.attachments.push_back(Store(attachment));
  return {};
}

Result<void> CollectingVisitor::OnMetadata(const Metadata& metadata, const MetadataIndex& /*index*/) {
  content.metadata.push_back(metadata);
  return {};
}

std::string FindingsOf(const CheckReport& report) {
  std::string text;
  for (const Finding& finding : report.findings) {
    text += (finding.severity == Severity::kError ? "error at " : "warning at ") +
            std::to_string(finding.offset) + ": " + finding.what + "\n";
  }
  return text;
}

}  // namespace taclink::mcap::testing
