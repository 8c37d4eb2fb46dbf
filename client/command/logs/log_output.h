#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "mcap/file_sink.h"
#include "mcap/reader.h"
#include "mcap/writer.h"

namespace taclink::command {

/// A file that was not there before and is gone again unless Keep is called.
class NewFile {
 public:
  /// Errors: as FileSink::Create, among them that it is there already.
  static Result<std::unique_ptr<NewFile>> Create(const std::string& path);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  mcap::FileSink& sink() { return *sink_; }
  const std::string& path() const { return sink_->path(); }
  void Keep() { kept_ = true; }

 private:
  explicit NewFile(std::unique_ptr<mcap::FileSink> sink) : sink_(std::move(sink)) {}

  const std::unique_ptr<mcap::FileSink> sink_;
  bool kept_ = false;
};

/// A new log.
class OutputLog {
 public:
  /// Errors: as NewFile::Create.
  static Result<std::unique_ptr<OutputLog>> Create(const std::string& path, mcap::WriterOptions options);

  mcap::Writer& writer() { return *writer_; }
  /// Closes the log, waits until it is on the disk, keeps it and says on stdout what it holds. Errors: the
  /// sink's.
  Result<void> Finish();

 private:
  explicit OutputLog(std::unique_ptr<NewFile> file) : file_(std::move(file)) {}

  const std::unique_ptr<NewFile> file_;
  std::unique_ptr<mcap::Writer> writer_;
};

/// A new text file. Memory: one buffer.
class OutputText {
 public:
  /// Errors: as NewFile::Create.
  static Result<std::unique_ptr<OutputText>> Create(const std::string& path);

  /// Errors: the sink's.
  Result<void> Write(std::string_view text);
  /// Errors: the sink's.
  Result<void> Finish();
  const std::string& path() const { return file_->path(); }

 private:
  explicit OutputText(std::unique_ptr<NewFile> file) : file_(std::move(file)) {}
  Result<void> Flush();

  const std::unique_ptr<NewFile> file_;
  std::string buffer_;
};

/// `wanted` is "none", "zstd", "lz4", or empty: as the log's first chunk is. Errors: kUnsupported.
Result<mcap::Compression> CompressionFor(const mcap::Reader& reader, const std::string& wanted);

}  // namespace taclink::command
