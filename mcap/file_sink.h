#pragma once

#include <memory>
#include <string>

#include "mcap/byte_sink.h"
#include "mcap/file_calls.h"

namespace taclink::mcap {

/// A new file, which others than owner and group may not read. It is locked (flock) until this object is
/// destroyed, where its file system has locks: who finds it unlocked may take it for left behind. Errors name
/// the path, what the system said, and what to do.
class FileSink : public ByteSink {
 public:
  /// Errors: kFailedPrecondition (the file exists, or another process has locked it), kNotFound (its folder
  /// is not), kPermissionDenied, kResourceExhausted (the disk is full), kUnavailable (what else the system
  /// says). `calls` must outlive it.
  static Result<std::unique_ptr<FileSink>> Create(const std::string& path,
                                                  FileCalls& calls = FileCalls::System());
  ~FileSink() override;
  FileSink(const FileSink&) = delete;
  FileSink& operator=(const FileSink&) = delete;

  Result<void> Append(std::span<const Bytes> pieces) override;
  Result<void> Sync() override;
  Result<void> Truncate(uint64_t position) override;
  uint64_t position() const override { return position_; }
  const std::string& path() const { return path_; }

  /// Whether what is written here is what one finds under the path.
  enum class Place {
    kThere,
    kElsewhere,  ///< the file was renamed, or its folder, or the disk taken off the tree
    kNowhere,    ///< it was deleted: what is written is gone once it is closed
    kCut,        ///< another program has cut it
  };
  Place WhereItIs() const;

 private:
  bool IsCut() const;
  FileSink(std::string path, int file, FileCalls& calls)
      : path_(std::move(path)), file_(file), calls_(calls) {}

  const std::string path_;
  const int file_;
  FileCalls& calls_;
  uint64_t position_ = 0;
};

}  // namespace taclink::mcap
