#pragma once

#include <map>
#include <optional>

#include "wire/mcap/resync.h"
#include "wire/mcap/scan.h"
#include "wire/mcap/summary.h"

namespace taclink::mcap {

/// One pass of Scan.
class Scanner {
 public:
  Scanner(const ByteSource& source, ScanVisitor& visitor, const ScanOptions& options);
  Result<ScanReport> Run();

 private:
  /// What a step does with the bytes from offset_ on.
  struct Place {
    uint64_t offset = 0;    ///< of the record
    uint64_t end = 0;       ///< of the record, as its length says
    uint64_t next = 0;      ///< where records go on; before `end`: the length is wrong
    bool doubtful = false;  ///< may be what is left of a damaged chunk
    bool length_is_right() const { return next >= end; }
  };

  Result<void> Step();
  /// Notes an error of the visitor's, which ends the scan; others are damage.
  Result<void> Told(Result<void> result);
  void SkipDamage(uint64_t from, uint64_t to, const std::string& why);
  void EnterRun(uint64_t offset);
  Result<void> TakeRecordAt(const Place& place, Opcode opcode);
  Result<void> Take(const Place& place, const RawRecord& record);
  /// Whether a decoded record fills its length, or records do not go on where its fields end: a later version
  /// may have added fields. Otherwise its length is damaged, and the next step begins there.
  template <typename T>
  Result<void> CheckLength(const Place& place, const T& record);
  Result<void> TakeDefinition(const Place& place, const RawRecord& record);
  Result<void> TakeTopMessage(const Place& place, Bytes content);
  Result<void> TakeAttachment(const Place& place, Bytes content);
  Result<void> TakeMetadata(const Place& place, Bytes content);
  Result<void> TakeChunk(const Place& place, Bytes content);
  Result<void> TakeDamagedChunk(const Place& place, const Chunk& chunk, const Error& error);
  /// Returns how many bytes of the records parsed.
  Result<size_t> TakeChunkRecords(Bytes records, const MessagePlace& place, ChunkIndex& index);
  uint64_t CountMessages(Bytes records) const;
  Result<void> TakeSchema(const Schema& schema);
  Result<void> TakeChannel(const Channel& channel);
  Result<bool> TakeMessage(const Message& message, const MessagePlace& place);
  Result<bool> FindChannel(uint16_t id);
  void NoteSequence(const Message& message);

  const ByteSource& source_;
  ScanVisitor& visitor_;
  const ScanOptions options_;
  Resync resync_;
  std::optional<Summary> summary_;  // only when its CRC is right
  std::map<uint16_t, Schema> schemas_;
  std::map<uint16_t, Channel> channels_;
  std::map<uint16_t, uint32_t> sequences_;  // newest of each channel
  Buffer record_;
  Buffer chunk_;
  uint64_t offset_ = 0;
  uint64_t doubtful_until_ = 0;
  std::optional<uint64_t> resume_;  // where a damaged record ends, if not at its end
  bool has_chunks_ = false;
  bool data_ended_ = false;  // what follows is the summary, where one wrong bit makes a channel a message
  std::optional<Error> told_wrong_;
  ScanReport report_;
};

}  // namespace taclink::mcap
