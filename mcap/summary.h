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

/// What a log says about itself at its end, or what a scan found in its place.
struct Summary {
  Header header;
  std::map<uint16_t, Schema> schemas;
  std::map<uint16_t, Channel> channels;
  std::optional<Statistics> statistics;
  std::vector<ChunkIndex> chunk_indexes;  ///< in the order of the file
  std::vector<AttachmentIndex> attachment_indexes;
  std::vector<MetadataIndex> metadata_indexes;
};

/// Footer, and where it begins.
struct PlacedFooter {
  Footer footer;
  uint64_t offset = 0;
};
/// Errors: kInvalidArgument (the end is missing or damaged), or the source's.
Result<PlacedFooter> ReadFooter(const ByteSource& source);

/// Checked by its CRC if it has one. Errors: kNotFound (there is no summary), kInvalidArgument (damaged),
/// kResourceExhausted (above the limit), or the source's.
Result<Summary> ReadSummary(const ByteSource& source, const Limits& limits);
/// All of it but the header, which stands at the log's other end.
Result<Summary> ReadSummarySection(const ByteSource& source, const Limits& limits);
/// The same of a log that lacks bytes before it, so that its end says a wrong place: behind the end of the
/// data, where its CRC is right.
Result<Summary> FindMovedSummary(const ByteSource& source);

/// Whether all that the log holds can be found by `summary`: empty, or why not.
std::string Incomplete(const Summary& summary);

}  // namespace taclink::mcap
