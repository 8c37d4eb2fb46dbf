#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mcap/file_sink.h"
#include "server/recording/log_folder.h"
#include "taclink/v1/recording.pb.h"
#include "wire/log/log_writer.h"

namespace taclink::server {

/// What every log of a recording begins with.
struct LogPreamble {
  struct File {
    std::string name, media_type, text;
  };
  std::vector<File> files;                        ///< attachments
  std::map<std::string, mcap::TextMap> metadata;  ///< by the record's name
};

/// A log that is being written, under its name with ".part".
class LogFile {
 public:
  /// Errors: as mcap::FileSink::Create and Append.
  static Result<std::unique_ptr<LogFile>> Create(const LogFolder& folder, const std::string& name,
                                                 const LogPreamble& preamble, mcap::WriterOptions options,
                                                 int64_t utc_ns);

  /// Deletes the file of a log in which there is nothing yet.
  void Discard();

  wire::log::LogWriter& writer() { return *writer_; }
  const std::string& name() const { return name_; }
  int64_t started_utc_ns() const { return started_utc_ns_; }
  uint64_t bytes() const { return sink_->position(); }
  /// Chunks that the file has taken: what was written before the newest one ended is in it.
  uint64_t chunks() const { return writer_->mcap().statistics().chunk_count; }

  /// The open chunk is in the file. Errors: the system's; then it is lost.
  Result<void> Flush() { return writer_->mcap().Flush(); }
  /// All that was written is safe from a power cut. Errors: the system's; then what was written since the
  /// last Sync may be lost, also what the file has taken: the system has dropped it, and the next Sync would
  /// not tell [rebello2020].
  Result<void> Sync() { return writer_->mcap().Sync(); }
  mcap::FileSink::Place WhereItIs() const { return sink_->WhereItIs(); }
  /// Ends the log and gives it its final name, or, where its file was moved, leaves it there. Errors: the
  /// system's; then it stays ".part".
  Result<void> Close(mcap::TextMap totals, const v1::LogSummary& summary);
  /// All of it is safe from a power cut, by Close, whatever its name.
  bool is_complete() const { return is_complete_; }

 private:
  LogFile(LogFolder folder, std::string name, std::unique_ptr<mcap::FileSink> sink, int64_t utc_ns)
      : folder_(std::move(folder)), name_(std::move(name)), sink_(std::move(sink)), started_utc_ns_(utc_ns) {}

  Result<void> Begin(const LogPreamble& preamble, mcap::WriterOptions options);

  const LogFolder folder_;
  const std::string name_;
  const std::unique_ptr<mcap::FileSink> sink_;
  const int64_t started_utc_ns_;
  bool is_complete_ = false;
  std::unique_ptr<wire::log::LogWriter> writer_;
};

}  // namespace taclink::server
