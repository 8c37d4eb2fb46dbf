#pragma once

#include <array>
#include <cstdint>
#include <fstream>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "client/command/logs/log_output.h"

namespace taclink::command {

enum class NpyType : uint8_t { kUint8, kInt64, kUint64, kFloat32, kFloat64 };

template <typename T>
constexpr NpyType NpyTypeOf() {
  if constexpr (std::is_same_v<T, uint8_t>) return NpyType::kUint8;
  if constexpr (std::is_same_v<T, int64_t>) return NpyType::kInt64;
  if constexpr (std::is_same_v<T, uint64_t>) return NpyType::kUint64;
  if constexpr (std::is_same_v<T, float>) return NpyType::kFloat32;
  if constexpr (std::is_same_v<T, double>) return NpyType::kFloat64;
}

struct NpyArray {
  std::string name = {};
  NpyType type = NpyType::kFloat64;
  std::vector<uint64_t> shape = {};  ///< row by row (C order)

  uint64_t count() const;
  uint64_t bytes() const;
};

/// NumPy's format: .npy 1.0 files in a zip archive that does not compress (numpy.org, "numpy.lib.format";
/// PKWARE's APPNOTE 6.3). All sizes are known from the start, so that the arrays can be filled by turns: each
/// has its place in the file. Memory: one buffer for each array.
class NpzWriter {
 public:
  /// Sizes and offsets from here on are written in the zip64 way.
  static constexpr uint64_t kZip64From = 0xFFFF'FFFF;

  /// Errors: as NewFile::Create.
  static Result<std::unique_ptr<NpzWriter>> Create(const std::string& path, std::vector<NpyArray> arrays,
                                                   uint64_t zip64_from = kZip64From);

  /// The next values of an array, of its type. Errors: kInternal (another type, more than fit),
  /// kResourceExhausted (the disk).
  template <typename T>
  Result<void> Append(size_t array, std::span<const T> values) {
    return AppendBytes(array, NpyTypeOf<T>(), std::as_bytes(values));
  }
  template <typename T>
  Result<void> Append(size_t array, T value) {
    return Append(array, std::span<const T>(&value, 1));
  }
  /// Errors: kInternal (an array is not full), kResourceExhausted (the disk).
  Result<void> Finish();

 private:
  struct Member {
    NpyArray array;
    std::string header = {};    // of the .npy file
    uint64_t offset = 0;        // of the zip's local header
    uint64_t size = 0;          // of the .npy file
    uint64_t data_written = 0;  // of the array, in the file
    uint32_t crc = 0;
    mcap::Buffer waiting = {};
  };

  explicit NpzWriter(uint64_t zip64_from) : zip64_from_(zip64_from) {}
  Result<void> AppendBytes(size_t array, NpyType type, mcap::Bytes bytes);
  Result<void> FlushMember(Member& member);
  Result<void> WriteAt(uint64_t offset, mcap::Bytes bytes);
  uint64_t DataOffset(const Member& member) const;
  mcap::Buffer LocalHeader(const Member& member) const;
  void AppendDirectoryEntry(const Member& member, mcap::Buffer& out) const;
  void AppendEnd(uint64_t offset, uint64_t size, mcap::Buffer& out) const;

  const uint64_t zip64_from_;
  std::unique_ptr<NewFile> place_;
  std::ofstream file_;
  std::vector<Member> members_;
  uint64_t end_ = 0;  // of the members
};

}  // namespace taclink::command
