#include "mcap/recover.h"

#include <map>
#include <memory>

namespace taclink::mcap {
namespace {

class CopyingVisitor : public ScanVisitor {
 public:
  CopyingVisitor(ByteSink& sink, WriterOptions options) : sink_(sink), options_(std::move(options)) {}

  Result<void> OnHeader(const Header& header) override {
    options_.profile = header.profile;
    options_.library = header.library;
    return Begin();
  }

  Result<void> OnSchema(const Schema& schema) override {
    if (const auto begun = Begin(); !begun) return begun;
    return Keep(schema, schemas_, &Writer::KeepSchema, &Writer::AddSchema);
  }

  Result<void> OnChannel(const Channel& channel) override {
    if (const auto begun = Begin(); !begun) return begun;
    Channel copy = channel;
    if (channel.schema_id != 0) {
      const auto schema = schemas_.find(channel.schema_id);
      if (schema == schemas_.end()) ++channels_without_schema_;
      copy.schema_id = schema == schemas_.end() ? uint16_t{0} : schema->second;
    }
    return Keep(copy, channels_, &Writer::KeepChannel, &Writer::AddChannel);
  }

  Result<void> OnMessage(const Message& message, const MessagePlace& /*place*/) override {
    Message copy = message;
    copy.channel_id = channels_.at(message.channel_id);
    return writer_->Write(copy);
  }

  Result<void> OnAttachment(const Attachment& attachment, const AttachmentIndex& /*index*/) override {
    if (const auto begun = Begin(); !begun) return begun;
    return writer_->AddAttachment(attachment);
  }

  Result<void> OnMetadata(const Metadata& metadata, const MetadataIndex& /*index*/) override {
    if (const auto begun = Begin(); !begun) return begun;
    return writer_->AddMetadata(metadata);
  }

  Result<void> Close() {
    if (const auto begun = Begin(); !begun) return begun;
    return writer_->Close();
  }

  const Statistics& written() const { return writer_->statistics(); }
  uint64_t channels_without_schema() const { return channels_without_schema_; }

 private:
  using Ids = std::map<uint16_t, uint16_t>;  // by the id in the source

  Result<void> Begin() {
    if (writer_) return {};
    auto writer = Writer::Create(sink_, options_);
    if (!writer) return writer.error();
    writer_ = std::move(*writer);
    return {};
  }

  /// Under its id, or under another one where the log gives that a second meaning.
  template <typename T>
  Result<void> Keep(const T& record, Ids& ids, Result<void> (Writer::*keep)(T),
                    Result<uint16_t> (Writer::*add)(T)) {
    Result<uint16_t> id = record.id;
    if (!(writer_.get()->*keep)(record)) id = (writer_.get()->*add)(record);
    if (!id) return id.error();
    ids[record.id] = *id;
    return {};
  }

  ByteSink& sink_;
  WriterOptions options_;
  std::unique_ptr<Writer> writer_;
  Ids schemas_;
  Ids channels_;
  uint64_t channels_without_schema_ = 0;
};

}  // namespace

Result<RecoverReport> Recover(const ByteSource& source, ByteSink& sink, const RecoverOptions& options) {
  CopyingVisitor visitor(sink, options.writer);
  auto scanned = Scan(source, visitor, options.scan);
  if (!scanned) return scanned.error();
  if (const auto closed = visitor.Close(); !closed) return closed.error();
  return RecoverReport{.scan = std::move(*scanned),
                       .written = visitor.written(),
                       .channels_without_schema = visitor.channels_without_schema()};
}

}  // namespace taclink::mcap
