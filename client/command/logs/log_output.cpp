#include "client/command/logs/log_output.h"

#include <fmt/format.h>

#include <array>
#include <filesystem>

namespace taclink::command {
namespace {

constexpr size_t kBufferBytes = size_t{1} << 18;

}  // namespace

Result<std::unique_ptr<NewFile>> NewFile::Create(const std::string& path) {
  auto sink = mcap::FileSink::Create(path);
  if (!sink) return sink.error();
  return std::unique_ptr<NewFile>(new NewFile(std::move(*sink)));
}

NewFile::~NewFile() {
  std::error_code ignored;
  if (!kept_) std::filesystem::remove(path(), ignored);
}

Result<std::unique_ptr<OutputLog>> OutputLog::Create(const std::string& path, mcap::WriterOptions options) {
  auto file = NewFile::Create(path);
  if (!file) return file.error();
  std::unique_ptr<OutputLog> log(new OutputLog(std::move(*file)));
  auto writer = mcap::Writer::Create(log->file_->sink(), std::move(options));
  if (!writer) return writer.error();
  log->writer_ = std::move(*writer);
  return log;
}

Result<void> OutputLog::Finish() {
  if (const auto closed = writer_->Close(); !closed) return closed;
  if (const auto synced = file_->sink().Sync(); !synced) return synced;
  file_->Keep();
  const mcap::Statistics& written = writer_->statistics();
  fmt::print("{}: {} messages, {} attachments\n", file_->path(), written.message_count,
             written.attachment_count);
  return {};
}

Result<std::unique_ptr<OutputText>> OutputText::Create(const std::string& path) {
  auto file = NewFile::Create(path);
  if (!file) return file.error();
  return std::unique_ptr<OutputText>(new OutputText(std::move(*file)));
}

Result<void> OutputText::Write(std::string_view text) {
  buffer_ += text;
  return buffer_.size() < kBufferBytes ? Result<void>() : Flush();
}

Result<void> OutputText::Flush() {
  const std::array<mcap::Bytes, 1> pieces = {mcap::AsBytes(buffer_)};
  const auto written = file_->sink().Append(pieces);
  buffer_.clear();
  return written;
}

Result<void> OutputText::Finish() {
  if (const auto flushed = Flush(); !flushed) return flushed;
  file_->Keep();
  return {};
}

Result<mcap::Compression> CompressionFor(const mcap::Reader& reader, const std::string& wanted) {
  if (wanted == "none") return mcap::Compression::kNone;
  if (!wanted.empty()) return mcap::CompressionFrom(wanted);
  if (reader.chunk_indexes().empty()) return mcap::Compression::kNone;
  return mcap::CompressionFrom(reader.chunk_indexes().front().compression);
}

}  // namespace taclink::command
