#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mcap/check.h"
#include "mcap/cursor.h"
#include "mcap/reader.h"
#include "mcap/scan.h"
#include "mcap/writer.h"

namespace taclink::mcap::testing {

struct StoredMessage {
  std::string topic;
  std::string schema;
  uint32_t sequence = 0;
  uint64_t log_time_ns = 0;
  uint64_t publish_time_ns = 0;
  std::string data;
  auto operator<=>(const StoredMessage&) const = default;
};

struct StoredAttachment {
  uint64_t log_time_ns = 0;
  uint64_t create_time_ns = 0;
  std::string name;
  std::string media_type;
  std::string data;
  auto operator<=>(const StoredAttachment&) const = default;
};

/// All that a log is to keep, in its order.
struct LogContent {
  std::string profile;
  std::vector<StoredMessage> messages;
  std::vector<StoredAttachment> attachments;
  std::vector<Metadata> metadata;
  bool operator==(const LogContent&) const = default;
};

/// Writes random logs, the same for the same seed: a few channels with and without schema, messages of 0 B to
/// 20 kB whose log times mostly rise, attachments and metadata among them.
struct RandomLog {
  uint32_t seed = 1;
  size_t messages = 200;
  WriterOptions options = {.chunk_bytes = 8000};

  /// Returns what was written.
  LogContent WriteTo(ByteSink& sink) const;
};
Buffer RandomLogBytes(const RandomLog& log, LogContent* content = nullptr);

/// A log of a few hundred bytes that holds every type of record.
Buffer SmallLog(Compression compression = Compression::kNone);

/// What the specification leaves open, and other writers leave out.
enum class ForeignForm {
  kNoSummary,
  kNoStatistics,
  kNoChunkIndexes,
  kNoChunks,  ///< their messages stand in the data section; with statistics
  kNoChunksNoSummary,
  kLastChunkInPieces,    ///< only the last chunk's messages stand in the data section
  kNoChannelsInSummary,  ///< nor schemas: no record of the summary names one
};
inline constexpr ForeignForm kForeignForms[] = {
    ForeignForm::kNoSummary,          ForeignForm::kNoStatistics,      ForeignForm::kNoChunkIndexes,
    ForeignForm::kNoChunks,           ForeignForm::kNoChunksNoSummary, ForeignForm::kLastChunkInPieces,
    ForeignForm::kNoChannelsInSummary};
/// The content of a log that is whole in that form.
Buffer AsOthersWrite(Bytes log, ForeignForm form);

/// Everything in a log, as a reader finds it. Empty with `*error` set at the first error.
LogContent ReadAll(Bytes bytes, std::string* error, MessageOrder order = MessageOrder::kFile);

/// Collects what a scan finds.
class CollectingVisitor : public ScanVisitor {
 public:
  Result<void> OnHeader(const Header& header) override;
  Result<void> OnSchema(const Schema& schema) override;
  Result<void> OnChannel(const Channel& channel) override;
  Result<void> OnMessage(const Message& message, const MessagePlace& place) override;
  Result<void> OnAttachment(const Attachment& attachment, const AttachmentIndex& index) override;
  Result<void> OnMetadata(const Metadata& metadata, const MetadataIndex& index) override;
  LogContent content;

 private:
  std::map<uint16_t, Schema> schemas_;
  std::map<uint16_t, Channel> channels_;
};

std::string Text(Bytes bytes);
std::string FindingsOf(const CheckReport& report);

}  // namespace taclink::mcap::testing
