#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "mcap/byte_sink.h"
#include "mcap/chunk_builder.h"
#include "mcap/compression.h"
#include "mcap/records.h"

namespace taclink::mcap {

struct WriterOptions {
  std::string profile = {};
  std::string library = "taclink";
  Compression compression = Compression::kNone;
  int level = 0;                             ///< the compression library's; 0: its default
  uint64_t chunk_bytes = uint64_t{1} << 20;  ///< a chunk ends when it has reached this, uncompressed
  bool crcs = true;                          ///< of chunks, attachments, data section, summary
};

/// Writes a log: messages in chunks with message indexes, and at the end a summary with all indexes.
///
/// When the sink fails, what was handed to it before stays a readable log: the torn end is cut off at once,
/// or, if that fails too, before anything else is written. The messages of the chunk that could not be
/// written are lost and counted; the writer can go on afterwards. For one thread at a time.
class Writer {
 public:
  /// Writes the header; `sink` is empty and outlives the writer. Errors: kInvalidArgument, or the sink's.
  static Result<std::unique_ptr<Writer>> Create(ByteSink& sink, WriterOptions options = {});

  /// Returns the id: the next free one from 1 on; the record's own is ignored. They are written with the
  /// first message that needs them, or by Close. Errors: kInvalidArgument (no such schema),
  /// kResourceExhausted (no id is free).
  Result<uint16_t> AddSchema(Schema schema);
  Result<uint16_t> AddChannel(Channel channel);
  /// The same with the id that the record has, as copies of logs need it: it is free, or in use by the same
  /// record. A channel may have the id 0; of schemas, 0 means none. Errors: kInvalidArgument (in use by
  /// another one, a schema 0, no such schema).
  Result<void> KeepSchema(Schema schema);
  Result<void> KeepChannel(Channel channel);

  /// Errors: kInvalidArgument (unknown channel, larger than half of kMaxChunkBytes; nothing is lost), or the
  /// sink's, when the chunk is full; then this message is lost with it.
  Result<void> Write(const Message& message) { return Write(message, nullptr); }
  /// The same, but large data of an uncompressed log are not copied: `owner` keeps them, unchanged, until
  /// they are handed to the sink.
  Result<void> Write(const Message& message, std::shared_ptr<const void> owner);

  /// Handed to the sink at once, before the messages of the open chunk. `crc` is ignored. Errors:
  /// kInvalidArgument (larger than kMaxChunkBytes), or the sink's.
  Result<void> AddAttachment(const Attachment& attachment);
  Result<void> AddMetadata(const Metadata& metadata);

  /// Ends the open chunk, so that the sink has everything. Errors: the sink's.
  Result<void> Flush();
  /// Flush, then the sink's Sync.
  Result<void> Sync();
  /// Ends the log with its summary; nothing can be written afterwards. After an error it can be called again.
  /// A log that is not closed has no summary, but is readable. Errors: the sink's.
  Result<void> Close();

  /// Of what the sink has taken.
  const Statistics& statistics() const { return statistics_; }
  /// Messages whose chunk the sink did not take, by channel.
  const ChannelMap& lost() const { return lost_; }
  uint64_t open_bytes() const { return chunk_.size(); }  ///< that wait in the open chunk

 private:
  Writer(ByteSink& sink, WriterOptions options);

  Result<void> CheckOpen() const;
  Result<void> CheckSchemaOf(const Channel& channel) const;
  void Declare(const Channel& channel);
  Result<void> Hand(std::span<const Bytes> pieces);
  Result<void> EndChunk();
  Result<void> HandChunk();
  void CommitChunk(ChunkIndex index);
  void ForgetChunk();
  uint32_t CrcOf(Bytes bytes, uint32_t before = 0) const;

  // Constant after construction.
  ByteSink& sink_;
  const WriterOptions options_;

  Compressor compressor_;
  std::map<uint16_t, Schema> schemas_;
  std::map<uint16_t, Channel> channels_;
  std::set<uint16_t> written_schemas_;   // in the sink
  std::set<uint16_t> written_channels_;  // in the sink
  std::set<uint16_t> open_schemas_;      // in the open chunk
  std::set<uint16_t> open_channels_;     // in the open chunk
  ChunkBuilder chunk_;
  Buffer compressed_;
  Buffer scratch_;

  Statistics statistics_;
  std::vector<ChunkIndex> chunk_indexes_;
  std::vector<AttachmentIndex> attachment_indexes_;
  std::vector<MetadataIndex> metadata_indexes_;
  ChannelMap lost_;
  uint64_t end_ = 0;       // of what is whole in the sink
  bool torn_ = false;      // the sink has bytes behind end_
  uint32_t data_crc_ = 0;  // of the bytes before end_
  bool closed_ = false;
};

}  // namespace taclink::mcap
