#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "mcap/reader.h"

namespace taclink::mcap {

enum class MessageOrder : uint8_t {
  kLogTime,         ///< by log time, those of the same time as they are in the file
  kReverseLogTime,  ///< exactly the other way round
  kFile,            ///< as they are in the file
};

struct CursorOptions {
  uint64_t start_ns = 0;                            ///< the first log time that is wanted
  uint64_t end_ns = UINT64_MAX;                     ///< the last one
  std::optional<std::set<uint16_t>> channels = {};  ///< nullopt: all
  MessageOrder order = MessageOrder::kLogTime;
};

/// Goes over a log's messages. Only chunks that overlap in time are in memory together; others are not read
/// before it is their turn, and those out of range not at all. For one thread; the reader outlives it.
class MessageCursor {
 public:
  MessageCursor(const Reader& reader, CursorOptions options);

  /// The next message; its data are valid until the next call. After another error than kEndOfData the next
  /// call goes on behind what could not be read. Errors: kEndOfData, kInvalidArgument (a damaged chunk, with
  /// its offset), kResourceExhausted (chunks above the limits), kUnsupported (compression), or the source's.
  Result<Message> Next();

  uint64_t blocks_read() const { return blocks_read_; }  ///< chunks that were loaded so far

 private:
  struct Entry {
    uint64_t time_ns = 0;
    Bytes content;
  };
  struct OpenBlock {
    size_t block = 0;  // in the order of the file
    Buffer bytes;
    std::vector<Entry> entries;  // taken from the back
  };

  bool Wanted(size_t block) const;
  bool MayComeFirst(size_t block) const;
  bool ComesLater(const OpenBlock& a, const OpenBlock& b) const;
  Result<void> Load(size_t block);
  Result<Bytes> LoadRecords(const MessageBlock& block, Buffer& bytes) const;
  Result<void> FindEntries(const MessageBlock& block, Bytes records, OpenBlock& out) const;
  void Push(std::unique_ptr<OpenBlock> open);

  const Reader& reader_;
  const CursorOptions options_;
  std::deque<size_t> pending_;                    // in the order in which they may be needed
  std::vector<std::unique_ptr<OpenBlock>> open_;  // a heap, the next message's block in front
  std::unique_ptr<OpenBlock> newest_;             // that the newest message lies in, if it was its last one
  uint64_t open_bytes_ = 0;
  uint64_t blocks_read_ = 0;
};

}  // namespace taclink::mcap
