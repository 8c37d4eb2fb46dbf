#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "client/command/cli/arguments.h"
#include "mcap/cursor.h"
#include "mcap/reader.h"

namespace taclink::command {

/// A log that a tool reads, and what of it could not be read.
class LogSource {
 public:
  /// A damaged or unfinished log opens too, with what is intact. Errors name the file: as FileSource::Open
  /// and mcap::Reader::Open.
  static Result<std::unique_ptr<LogSource>> Open(const std::string& file);

  const std::string& file() const { return file_; }
  const mcap::Reader& reader() const { return *reader_; }

  void NoteRead() { ++messages_read_; }
  /// What can't be read, and what can be read but is not understood. The same text twice counts once: some
  /// tools pass twice.
  void NoteDamage(const std::string& what);
  void NoteLeftOut(const std::string& what);

  /// Says on stderr what is missing and what to do about it. Errors: kInvalidArgument (damaged, and not one
  /// message of those that were wanted is left).
  Result<void> Report() const;

 private:
  LogSource(std::string file, std::unique_ptr<mcap::Reader> reader)
      : file_(std::move(file)), reader_(std::move(reader)) {}

  const std::string file_;
  const std::unique_ptr<mcap::Reader> reader_;
  std::set<std::string> damage_, left_out_;  // the first thousand each
  uint64_t messages_read_ = 0;
};

/// Goes over a log's messages, past what is damaged, which it notes. The source outlives it.
class LogMessages {
 public:
  LogMessages(LogSource& source, const mcap::CursorOptions& options);

  /// Its data are valid until the next call; none: there are no more.
  std::optional<mcap::Message> Next();
  /// Of the log time that is gone over, how much lies before the newest message; 0 to 1.
  double share() const { return share_; }

 private:
  LogSource& source_;
  mcap::MessageCursor cursor_;
  const uint64_t start_ns_, end_ns_;  // of what is gone over
  double share_ = 0;
};

/// What a command line says about which part of a log is meant.
struct PartOptions {
  std::string from, to;            ///< as ParseLogTime; empty: the log's ends
  std::vector<std::string> links;  ///< empty: all
};
void AddPartOptions(const Arguments& command, PartOptions& options);

struct LogPart {
  uint64_t start_ns = 0;         ///< the first log time
  uint64_t end_ns = UINT64_MAX;  ///< the last one
  std::set<std::string> links;   ///< empty: all

  bool Has(const std::string& link) const { return links.empty() || links.contains(link); }
};
/// Errors: kInvalidArgument (no time, from not before to, nothing of the log lies there), kNotFound (no such
/// link).
Result<LogPart> ChoosePart(const LogSource& source, const PartOptions& options);

/// Seconds after `start_ns`, or "2026-11-22T12:01:37.250Z" (or with a blank and " UTC", as `taclink log info`
/// writes it). ns since 1970-01-01 UTC. Errors: kInvalidArgument.
Result<uint64_t> ParseLogTime(const std::string& text, uint64_t start_ns);

/// The link whose channel this is; empty: the whole arm's, or of an unknown topic.
std::string LinkOf(const mcap::Channel& channel);

/// "a, b, c", for errors.
std::string Joined(const std::set<std::string>& names);

/// Channels of all arm's topics and of the part's links.
std::set<uint16_t> ChannelsOf(const mcap::Reader& reader, const LogPart& part);

/// Name of the channel's schema; empty: it has none.
std::string SchemaOf(const mcap::Reader& reader, const mcap::Channel& channel);

}  // namespace taclink::command
