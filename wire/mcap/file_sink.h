#pragma once

#include <memory>
#include <string>

#include "wire/mcap/byte_sink.h"

namespace taclink::mcap {

/// A new file. Errors name the path, what the system said, and what to do.
class FileSink : public ByteSink {
 public:
  /// Errors: kFailedPrecondition (the file is there already), kNotFound (its folder is not),
  /// kPermissionDenied, kResourceExhausted (the disk is full), kUnavailable (what else the system says).
  static Result<std::unique_ptr<FileSink>> Create(const std::string& path);
  ~FileSink() override;
  FileSink(const FileSink&) = delete;
  FileSink& operator=(const FileSink&) = delete;

  Result<void> Append(std::span<const Bytes> pieces) override;
  Result<void> Sync() override;
  Result<void> Truncate(uint64_t position) override;
  uint64_t position() const override { return position_; }
  const std::string& path() const { return path_; }

 private:
  FileSink(std::string path, int file) : path_(std::move(path)), file_(file) {}

  const std::string path_;
  const int file_;
  uint64_t position_ = 0;
};

}  // namespace taclink::mcap
