#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mcap/byte_source.h"
#include "mcap/load.h"
#include "mcap/scan.h"
#include "mcap/summary.h"

namespace taclink::mcap {

/// A piece of a log that a cursor loads at once: a chunk, or messages outside of chunks that follow one
/// another.
struct MessageBlock {
  uint64_t offset = 0;
  uint64_t length = 0;  ///< of what is in the file
  uint64_t start_ns = 0;
  uint64_t end_ns = 0;
  bool is_chunk = true;
};

/// A log opened for reading. Any number of cursors and threads may use it at the same time.
class Reader {
 public:
  /// From the summary, if there is one, and it is intact and complete; otherwise by a scan of all bytes,
  /// which finds what is intact. A log without such a summary is damaged only if Check finds an error: the
  /// specification demands neither summary nor indexes nor chunks. Errors: kInvalidArgument (not an MCAP log,
  /// or channels that change their meaning midway; see Recover), or the source's.
  static Result<std::unique_ptr<Reader>> Open(std::shared_ptr<const ByteSource> source, Limits limits = {});

  const Header& header() const { return summary_.header; }
  const std::map<uint16_t, Schema>& schemas() const { return summary_.schemas; }
  const std::map<uint16_t, Channel>& channels() const { return summary_.channels; }
  /// After a scan: counted by it.
  const Statistics& statistics() const { return *summary_.statistics; }
  /// After a scan without message indexes.
  const std::vector<ChunkIndex>& chunk_indexes() const { return summary_.chunk_indexes; }
  const std::vector<AttachmentIndex>& attachments() const { return summary_.attachment_indexes; }
  const std::vector<MetadataIndex>& metadata() const { return summary_.metadata_indexes; }

  /// What the scan found; nullopt: the summary was used.
  const std::optional<ScanReport>& scan() const { return scan_; }
  /// What is damaged, or that the log was not closed; empty: the summary was used, or Check finds no error.
  const std::string& summary_problem() const { return summary_problem_; }

  /// The attachment's `data` lie in `buffer`. Errors: kInvalidArgument (damaged, with its offset),
  /// kResourceExhausted (above the limit), or the source's.
  Result<Attachment> ReadAttachment(const AttachmentIndex& index, Buffer& buffer) const;
  Result<Metadata> ReadMetadata(const MetadataIndex& index) const;

 private:
  friend class MessageCursor;
  friend class IndexingVisitor;

  Reader(std::shared_ptr<const ByteSource> source, Limits limits)
      : source_(std::move(source)), limits_(limits) {}

  Result<void> UseScan(bool is_intact);
  void UseSummary(Summary summary);

  const std::shared_ptr<const ByteSource> source_;
  const Limits limits_;
  Summary summary_;
  std::vector<MessageBlock>
      blocks_;  // in the order of the file; the chunks are chunk_indexes_' in their order
  std::optional<ScanReport> scan_;
  std::string summary_problem_;
};

}  // namespace taclink::mcap
