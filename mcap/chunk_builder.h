#pragma once

#include <map>
#include <memory>
#include <vector>

#include "mcap/records.h"

namespace taclink::mcap {

/// The records of a chunk that is still open. Large payloads may be kept by reference.
class ChunkBuilder {
 public:
  explicit ChunkBuilder(uint64_t reserve_bytes) { copied_.reserve(reserve_bytes); }

  void Add(const Schema& schema);
  void Add(const Channel& channel);
  /// `owner` keeps the message's data alive until Clear; null: they are copied.
  void Add(const Message& message, std::shared_ptr<const void> owner);
  void Clear();

  bool empty() const { return size_ == 0; }
  uint64_t size() const { return size_; }  ///< bytes of the records
  uint64_t start_ns() const { return messages_ == 0 ? 0 : start_ns_; }
  uint64_t end_ns() const { return end_ns_; }
  uint64_t messages() const { return messages_; }
  /// By channel; some may be empty.
  const std::map<uint16_t, MessageIndex>& indexes() const { return indexes_; }
  /// Appends the records' bytes, piece by piece; valid until the next change.
  void AppendPieces(std::vector<Bytes>& out) const;

 private:
  /// Bytes that lie elsewhere, after the first `copied_before` of the copied ones.
  struct Borrowed {
    size_t copied_before = 0;
    Bytes bytes;
    std::shared_ptr<const void> owner;
  };

  Buffer copied_;
  std::vector<Borrowed> borrowed_;
  std::map<uint16_t, MessageIndex> indexes_;
  uint64_t size_ = 0;
  uint64_t messages_ = 0;
  uint64_t start_ns_ = 0;
  uint64_t end_ns_ = 0;
};

}  // namespace taclink::mcap
