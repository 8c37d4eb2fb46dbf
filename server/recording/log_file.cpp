#include "server/recording/log_file.h"

#include <filesystem>
#include <utility>

namespace taclink::server {

Result<std::unique_ptr<LogFile>> LogFile::Create(const LogFolder& folder, const std::string& name,
                                                 const LogPreamble& preamble, mcap::WriterOptions options,
                                                 int64_t utc_ns) {
  auto sink = mcap::FileSink::Create(folder.PartPath(name), folder.calls());
  if (!sink) return sink.error();
  std::unique_ptr<LogFile> file(new LogFile(folder, name, std::move(*sink), utc_ns));
  if (const auto begun = file->Begin(preamble, std::move(options)); !begun) {
    file->Discard();
    return begun.error();
  }
  return file;
}

void LogFile::Discard() {
  std::error_code ignored;
  std::filesystem::remove(folder_.PartPath(name_), ignored);
}

Result<void> LogFile::Begin(const LogPreamble& preamble, mcap::WriterOptions options) {
  auto writer = wire::log::LogWriter::Create(*sink_, std::move(options));
  if (!writer) return writer.error();
  writer_ = std::move(*writer);
  for (const auto& [record, content] : preamble.metadata) {
    if (const auto added = writer_->AddMetadata(record, content); !added) return added.error();
  }
  for (const LogPreamble::File& one : preamble.files) {
    const auto added = writer_->AddAttachment(one.name, one.media_type, one.text, started_utc_ns_);
    if (!added) return added.error();
  }
  return {};
}

Result<void> LogFile::Close(mcap::TextMap totals, const v1::LogSummary& summary) {
  if (const auto flushed = writer_->mcap().Flush(); !flushed) return flushed.error();
  if (const auto added = writer_->AddMetadata(wire::log::kTotalsName, std::move(totals)); !added)
    return added.error();
  const auto attached = writer_->AddAttachment(wire::log::kSummaryName, wire::log::kSummaryType,
                                               summary.SerializeAsString(), started_utc_ns_);
  if (!attached) return attached.error();
  if (const auto closed = writer_->mcap().Close(); !closed) return closed.error();
  if (const auto synced = sink_->Sync(); !synced) return synced.error();
  is_complete_ = true;
  if (WhereItIs() == mcap::FileSink::Place::kElsewhere) return {};
  return folder_.Finish(name_);
}

}  // namespace taclink::server
