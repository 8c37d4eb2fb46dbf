#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mcap/byte_source.h"
#include "mcap/load.h"
#include "mcap/records.h"

namespace taclink::mcap {

/// Where a message was found.
struct MessagePlace {
  uint64_t offset = 0;  ///< of its record, or of its chunk's
  uint64_t length = 0;  ///< of that record
  bool in_chunk = false;
  bool verified = false;  ///< its chunk's CRC is right
};

/// Takes what a scan finds, in the order of the file; what is borrowed is valid during the call. Channels
/// come before their messages and schemas before their channels; the same id may come again as another one
/// (the report counts it). An error ends the scan.
class ScanVisitor {
 public:
  virtual ~ScanVisitor() = default;
  virtual Result<void> OnHeader(const Header& /*header*/) { return {}; }
  virtual Result<void> OnSchema(const Schema& /*schema*/) { return {}; }
  virtual Result<void> OnChannel(const Channel& /*channel*/) { return {}; }
  virtual Result<void> OnMessage(const Message& /*message*/, const MessagePlace& /*place*/) { return {}; }
  virtual Result<void> OnAttachment(const Attachment& /*attachment*/, const AttachmentIndex& /*index*/) {
    return {};
  }
  virtual Result<void> OnMetadata(const Metadata& /*metadata*/, const MetadataIndex& /*index*/) { return {}; }
  /// After its messages. The times are the messages'; there are no message indexes.
  virtual Result<void> OnChunk(const ChunkIndex& /*index*/) { return {}; }
};

struct ScanOptions {
  Limits limits = {};
  /// Also what lies in a damaged chunk and still parses. Off: it is dropped and counted, for its bytes may be
  /// wrong.
  bool keep_unverified = false;
  /// Check finds no error in the log: messages outside of its chunks are no remains of damaged ones.
  bool is_intact = false;
};

struct LostRange {
  uint64_t offset = 0;
  uint64_t length = 0;
  std::string why;
};

/// By a channel's sequence numbers.
struct SequenceGaps {
  uint64_t gaps = 0;
  uint64_t missing = 0;  ///< numbers left out, of all gaps
};

struct ScanReport {
  bool start_missing = false;  ///< no magic and header at the start
  bool end_missing = false;    ///< no footer and magic at the end: not closed, or cut off
  uint64_t messages = 0;       ///< found and handed to the visitor
  uint64_t unverified = 0;     ///< of these, without a CRC that covers them
  uint64_t dropped = 0;        ///< found in damaged chunks, but not to be trusted
  uint64_t orphans = 0;        ///< dropped, for their channel is lost
  uint64_t chunks = 0;         ///< intact
  uint64_t damaged_chunks = 0;
  uint64_t salvaged_chunks = 0;  ///< whose records are intact, though what says where they are is damaged
  uint64_t attachments = 0;
  uint64_t damaged_attachments = 0;
  uint64_t metadata = 0;
  uint64_t redefinitions = 0;    ///< schemas and channels that came again as another one
  uint64_t unknown_records = 0;  ///< of types that version 0 does not know; skipped
  std::map<uint16_t, uint64_t> channel_messages;
  std::map<uint16_t, SequenceGaps> sequence_gaps;  ///< only of channels that have any
  std::vector<LostRange> lost;                     ///< the first thousand
  uint64_t lost_bytes = 0;                         ///< of all
  std::optional<uint64_t> recorded_messages;       ///< what the log's own statistics say, if they are intact

  /// Nothing is lost or in doubt.
  bool clean() const {
    return !start_missing && !end_missing && lost_bytes == 0 && dropped == 0 && orphans == 0 &&
           damaged_chunks == 0 && damaged_attachments == 0 && redefinitions == 0 &&
           (!recorded_messages || *recorded_messages == messages);
  }
  /// For people, in one line.
  std::string Text() const;
};

/// Passes over all bytes once and hands over every record that is intact, whatever is damaged around it:
/// - A chunk counts as intact when its CRC is right; without CRC, as far as its records parse.
/// - A chunk whose own fields or length are damaged is found by its compression's frame, or by a length under
///   which its CRC is right, and counts if it is.
/// - After damage the pass goes on where a chain of records begins again. Messages there that may be the rest
///   of a chunk are dropped and counted (`keep_unverified`); those of a log without chunks are kept, for they
///   never have a CRC; in one with chunks, one outside of them is dropped, too.
/// - Channels and schemas whose record is lost come from the summary, if that is intact.
/// Memory is bounded by the limits. Errors: the source's and the visitor's.
Result<ScanReport> Scan(const ByteSource& source, ScanVisitor& visitor, const ScanOptions& options = {});

}  // namespace taclink::mcap
