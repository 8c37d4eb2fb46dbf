#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::server {

/// A file on its way to a client, read piece by piece.
struct StaticFile {
  std::string_view type;
  bool gzip = false;  ///< the content is compressed
  uint64_t size = 0;
  std::string tag;  ///< changes with the content
  bool never_changes = false;
  std::string_view content;  ///< of a file that is built in; else empty
  std::ifstream stream;      ///< of one on the disk

  /// Up to `count` bytes more; empty: none are left, or the disk failed.
  std::string Read(size_t count);

 private:
  size_t taken_ = 0;
};

/// The files of the web page: of a folder, or those that are built in.
class StaticFiles {
 public:
  /// `root` empty: those built in. Errors: kNotFound (no such folder, or no index.html in it).
  static Result<StaticFiles> Open(const std::string& root);

  /// `path` is PathOfTarget's; "/" is index.html. Compressed where that is built in and `gzip` is taken.
  /// Errors: kNotFound, also for folders and for links that lead out of the root.
  Result<StaticFile> Find(const std::string& path, bool gzip = false) const;

 private:
  static Result<StaticFile> FindBuiltIn(std::string_view name, bool gzip);

  std::string root_;  // canonical; empty: built in
};

}  // namespace taclink::server
