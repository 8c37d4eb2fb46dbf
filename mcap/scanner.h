#pragma once

#include <map>
#include <optional>

#include "mcap/resync.h"
#include "mcap/scan.h"
#include "mcap/summary.h"
#include "mcap/window.h"

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
  /// The same from `from` to offset_, but for chunks in there whose records are intact; offset_ is behind
  /// them.
  Result<void> TakeDamage(uint64_t from, const std::string& why);
  /// What is compressed between two places; `begin` at the second one: nothing that is to be kept.
  struct Frame {
    uint64_t begin = 0, end = 0;
    bool verified = false;
    uint64_t dropped = 0;  ///< messages of frames before it that can't be verified
  };
  Result<Frame> FindFrame(uint64_t from, uint64_t to);
  Result<uint64_t> LoadFrame(uint64_t begin, bool& verified);
  /// Errors: what claims to be another record, or an unknown one, is a chunk.
  Result<void> HidesChunk(const Place& place);
  Result<std::optional<uint64_t>> FindSparedChunk();
  Result<bool> TakeSparedChunk();
  Result<void> TakeSalvaged(const MessagePlace& place);
  template <typename T>
  std::optional<T> NumberAt(uint64_t offset);
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
  Window look_;
  std::optional<Summary> summary_;  // only when its CRC is right
  std::map<uint16_t, Schema> schemas_;
  std::map<uint16_t, Channel> channels_;
  std::map<uint16_t, uint32_t> sequences_;  // newest of each channel
  Buffer record_;
  Buffer chunk_;
  Buffer salvaged_;
  uint64_t offset_ = 0;
  uint64_t doubtful_until_ = 0;
  std::optional<uint64_t> resume_;  // where a damaged record ends, if not at its end
  bool has_chunks_ = false;
  bool data_ended_ = false;  // what follows is the summary, where one wrong bit makes a channel a message
  std::optional<Error> told_wrong_;
  ScanReport report_;
};

}  // namespace taclink::mcap
