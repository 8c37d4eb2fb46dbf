#pragma once

#include <cstdint>

#include "mcap/records.h"
#include "mcap/window.h"

namespace taclink::mcap {

/// Finds where records go on in damaged bytes.
class Resync {
 public:
  explicit Resync(const ByteSource& source) : source_(source), search_(source), look_(source) {}

  bool IsMagic(uint64_t offset);
  /// The record header at `offset`, when one can stand there: its type is not 0, it ends within the log, and
  /// it is long enough for its type. Length UINT64_MAX: none.
  RecordHeader HeaderAt(uint64_t offset);
  /// Whether the log ends at `offset`, or two records or magic can stand there.
  bool CanGoOn(uint64_t offset);
  /// Whether records can begin at `offset` after damage, as Find has it.
  bool IsStart(uint64_t offset);
  /// The first place from `offset` on where three records of known types follow one another (or fewer up to
  /// the end, magic, or a record that the end cuts off); the log's size if there is none.
  uint64_t Find(uint64_t offset);
  /// Where the run of schemas, channels and messages that begins at `offset` ends.
  uint64_t RunEnd(uint64_t offset);

 private:
  bool IsTorn(uint64_t offset);
  bool IsChain(uint64_t offset, int records, bool unknown_too);

  const ByteSource& source_;
  Window search_;
  Window look_;
};

constexpr uint64_t kNoRecord = UINT64_MAX;  ///< the length in place of a header that can't be one

}  // namespace taclink::mcap
