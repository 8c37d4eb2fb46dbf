#pragma once

#include <cstdint>

#include "mcap/byte_sink.h"
#include "mcap/scan.h"
#include "mcap/writer.h"

namespace taclink::mcap {

struct RecoverOptions {
  WriterOptions writer = {};  ///< profile and library are taken from the log, where its header is intact
  ScanOptions scan = {};
};

struct RecoverReport {
  ScanReport scan;
  Statistics written;
  uint64_t channels_without_schema = 0;  ///< whose schema is lost
};

/// Writes a complete log of all messages, attachments and metadata that a scan of `source` finds, in their
/// order. Ids are kept where they are unique; where an id changes its meaning midway the later one gets a new
/// id. Errors: the source's and the sink's.
Result<RecoverReport> Recover(const ByteSource& source, ByteSink& sink, const RecoverOptions& options = {});

}  // namespace taclink::mcap
