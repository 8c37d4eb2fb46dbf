#pragma once

#include <cstddef>
#include <string>

#include "sensing/core/result.h"

namespace taclink {

/// Of what people write by hand: models, scenes, configurations, robots' descriptions, keys.
inline constexpr size_t kMostTextBytes = size_t{16} << 20;
/// Of tables that programs write.
inline constexpr size_t kMostTableBytes = size_t{256} << 20;

/// Why the system could not read what is at `path`, from errno. kUnavailable says nothing of the file: this
/// machine could not read it now, for want of descriptors or memory, by an error of the disk, or interrupted.
/// The other codes do: kPermissionDenied, kNotFound.
Error FileError(const std::string& path, int number);

/// All of a file that a user names. Only a regular file: a pipe could keep the program waiting, a device
/// never ends. Errors name the path: kNotFound, kPermissionDenied, kInvalidArgument (no regular file, or
/// larger than `most_bytes`), kUnavailable (see FileError).
Result<std::string> ReadFile(const std::string& path, size_t most_bytes = kMostTextBytes);

/// ReadFile of a text, without the byte order mark with which some editors begin UTF-8: it is no part of the
/// first word. Errors: likewise.
Result<std::string> ReadText(const std::string& path, size_t most_bytes = kMostTextBytes);

/// Its first `bytes`, or all of it. Errors: likewise.
Result<std::string> ReadBeginning(const std::string& path, size_t bytes);

}  // namespace taclink
