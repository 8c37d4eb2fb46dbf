#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "mcap/bytes.h"
#include "sensing/core/result.h"

namespace taclink::mcap {

/// Where a log's bytes come from, at any place. Any number of threads may read.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  virtual uint64_t size() const = 0;
  /// Fills `out` with what stands at `offset`. Errors: kInvalidArgument (past the end), kUnavailable (what
  /// the system says).
  virtual Result<void> Read(uint64_t offset, std::span<std::byte> out) const = 0;
};

/// Borrowed memory.
class MemorySource : public ByteSource {
 public:
  explicit MemorySource(Bytes bytes) : bytes_(bytes) {}
  uint64_t size() const override { return bytes_.size(); }
  Result<void> Read(uint64_t offset, std::span<std::byte> out) const override;

 private:
  const Bytes bytes_;
};

/// A file of the length that it had when it was opened.
class FileSource : public ByteSource {
 public:
  /// Only a regular file; others are not opened. Errors: kNotFound, kPermissionDenied, kInvalidArgument (a
  /// pipe, a device, a folder), kUnavailable.
  static Result<std::unique_ptr<FileSource>> Open(const std::string& path);
  ~FileSource() override;
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;

  uint64_t size() const override { return size_; }
  Result<void> Read(uint64_t offset, std::span<std::byte> out) const override;

 private:
  FileSource(std::string path, int file, uint64_t size) : path_(std::move(path)), file_(file), size_(size) {}

  const std::string path_;
  const int file_;
  const uint64_t size_;
};

}  // namespace taclink::mcap
