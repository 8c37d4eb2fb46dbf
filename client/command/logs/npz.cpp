#include "client/command/logs/npz.h"

#include <fmt/format.h>

#include <bit>

#include "mcap/crc32.h"

namespace taclink::command {
namespace {

using mcap::AppendNumber;

static_assert(std::endian::native == std::endian::little, "arrays are written as they lie in memory");

constexpr size_t kBufferBytes = size_t{1} << 16;
constexpr uint32_t kSaturated = 0xFFFF'FFFF;  // the value stands in the zip64 field
constexpr uint16_t kZip64Field = 1;
constexpr uint16_t kVersion = 20, kZip64Version = 45;
constexpr uint16_t kUnixVersion = 3 << 8 | kZip64Version;
constexpr uint32_t kRegularFile = 0100644u << 16;
constexpr uint16_t kFirstDay = 1 << 5 | 1;  // 1980-01-01: the same content makes the same file
constexpr uint64_t kLocalHeaderBytes = 30, kLocalZip64Bytes = 20;

struct TypeName {
  const char* text;
  uint64_t bytes;
};

TypeName NameOf(NpyType type) {
  switch (type) {
    case NpyType::kUint8:
      return {"|u1", 1};
    case NpyType::kInt64:
      return {"<i8", 8};
    case NpyType::kUint64:
      return {"<u8", 8};
    case NpyType::kFloat32:
      return {"<f4", 4};
    case NpyType::kFloat64:
      break;
  }
  return {"<f8", 8};
}

/// Magic, version 1.0, and a Python dictionary, padded so that the data begin at a multiple of 64.
std::string NpyHeader(const NpyArray& array) {
  std::string shape;
  for (const uint64_t size : array.shape) shape += fmt::format("{}, ", size);
  if (array.shape.size() > 1) shape.resize(shape.size() - 2);
  if (array.shape.size() == 1) shape.resize(shape.size() - 1);
  std::string dictionary = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}",
                                       NameOf(array.type).text, shape);
  constexpr size_t kBefore = 10, kAlignment = 64;
  const size_t used = kBefore + dictionary.size() + 1;
  dictionary.append((kAlignment - used % kAlignment) % kAlignment, ' ');
  dictionary += '\n';
  const std::array<char, 4> magic = {'\x93', 'N', 'U', 'M'};
  std::string header(magic.begin(), magic.end());
  header += "PY";
  header += {'\x01', '\x00', static_cast<char>(dictionary.size() & 0xFF),
             static_cast<char>(dictionary.size() >> 8)};
  return header + dictionary;
}

std::string FileName(const NpyArray& array) {
  return array.name + ".npy";
}

Error DiskError(const std::string& path) {
  return {ErrorCode::kResourceExhausted, "can't write to '" + path + "'; is the disk full?"};
}

}  // namespace

uint64_t NpyArray::count() const {
  uint64_t product = 1;
  for (const uint64_t size : shape) product *= size;
  return product;
}

uint64_t NpyArray::bytes() const {
  return count() * NameOf(type).bytes;
}

Result<std::unique_ptr<NpzWriter>> NpzWriter::Create(const std::string& path, std::vector<NpyArray> arrays,
                                                     uint64_t zip64_from) {
  auto place = NewFile::Create(path);
  if (!place) return place.error();
  std::unique_ptr<NpzWriter> writer(new NpzWriter(zip64_from));
  writer->place_ = std::move(*place);
  writer->file_.open(path, std::ios::binary | std::ios::in | std::ios::out);
  if (!writer->file_) return DiskError(path);
  for (NpyArray& array : arrays) {
    Member member{.array = std::move(array)};
    member.header = NpyHeader(member.array);
    member.size = member.header.size() + member.array.bytes();
    member.offset = writer->end_;
    member.crc = mcap::Crc32(mcap::AsBytes(member.header));
    writer->end_ = writer->DataOffset(member) + member.array.bytes();
    writer->members_.push_back(std::move(member));
  }
  return writer;
}

uint64_t NpzWriter::DataOffset(const Member& member) const {
  const uint64_t zip64 = member.size >= zip64_from_ ? kLocalZip64Bytes : 0;
  return member.offset + kLocalHeaderBytes + FileName(member.array).size() + zip64 + member.header.size();
}

Result<void> NpzWriter::AppendBytes(size_t array, NpyType type, mcap::Bytes bytes) {
  Member& member = members_.at(array);
  const uint64_t filled = member.data_written + member.waiting.size() + bytes.size();
  if (type != member.array.type || filled > member.array.bytes())
    return Error{ErrorCode::kInternal, "values do not fit into the array " + member.array.name};
  mcap::AppendBytes(bytes, member.waiting);
  return member.waiting.size() < kBufferBytes ? Result<void>() : FlushMember(member);
}

Result<void> NpzWriter::FlushMember(Member& member) {
  const auto written = WriteAt(DataOffset(member) + member.data_written, member.waiting);
  member.crc = mcap::Crc32(member.waiting, member.crc);
  member.data_written += member.waiting.size();
  member.waiting.clear();
  return written;
}

Result<void> NpzWriter::WriteAt(uint64_t offset, mcap::Bytes bytes) {
  file_.seekp(static_cast<std::streamoff>(offset));
  file_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return file_ ? Result<void>() : DiskError(place_->path());
}

mcap::Buffer NpzWriter::LocalHeader(const Member& member) const {
  const bool zip64 = member.size >= zip64_from_;
  const uint32_t size = zip64 ? kSaturated : static_cast<uint32_t>(member.size);
  const std::string name = FileName(member.array);
  mcap::Buffer out;
  AppendNumber(uint32_t{0x0403'4B50}, out);
  AppendNumber(zip64 ? kZip64Version : kVersion, out);
  AppendNumber(uint16_t{0}, out);  // flags
  AppendNumber(uint16_t{0}, out);  // stored
  AppendNumber(uint16_t{0}, out);  // time
  AppendNumber(kFirstDay, out);
  AppendNumber(member.crc, out);
  AppendNumber(size, out);  // compressed
  AppendNumber(size, out);
  AppendNumber(static_cast<uint16_t>(name.size()), out);
  AppendNumber(static_cast<uint16_t>(zip64 ? kLocalZip64Bytes : 0), out);
  mcap::AppendBytes(mcap::AsBytes(name), out);
  if (zip64) {
    AppendNumber(kZip64Field, out);
    AppendNumber(uint16_t{16}, out);
    AppendNumber(member.size, out);
    AppendNumber(member.size, out);  // compressed
  }
  mcap::AppendBytes(mcap::AsBytes(member.header), out);
  return out;
}

void NpzWriter::AppendDirectoryEntry(const Member& member, mcap::Buffer& out) const {
  const bool large = member.size >= zip64_from_, far = member.offset >= zip64_from_;
  const uint32_t size = large ? kSaturated : static_cast<uint32_t>(member.size);
  const std::string name = FileName(member.array);
  const auto field_bytes = static_cast<uint16_t>((large ? 16 : 0) + (far ? 8 : 0));
  AppendNumber(uint32_t{0x0201'4B50}, out);
  AppendNumber(kUnixVersion, out);
  AppendNumber(large || far ? kZip64Version : kVersion, out);
  AppendNumber(uint16_t{0}, out);  // flags
  AppendNumber(uint16_t{0}, out);  // stored
  AppendNumber(uint16_t{0}, out);  // time
  AppendNumber(kFirstDay, out);
  AppendNumber(member.crc, out);
  AppendNumber(size, out);  // compressed
  AppendNumber(size, out);
  AppendNumber(static_cast<uint16_t>(name.size()), out);
  AppendNumber(static_cast<uint16_t>(field_bytes == 0 ? 0 : field_bytes + 4), out);
  AppendNumber(uint16_t{0}, out);  // comment
  AppendNumber(uint16_t{0}, out);  // disk
  AppendNumber(uint16_t{0}, out);  // internal attributes
  AppendNumber(kRegularFile, out);
  AppendNumber(far ? kSaturated : static_cast<uint32_t>(member.offset), out);
  mcap::AppendBytes(mcap::AsBytes(name), out);
  if (field_bytes == 0) return;
  AppendNumber(kZip64Field, out);
  AppendNumber(field_bytes, out);
  if (large) AppendNumber(member.size, out);
  if (large) AppendNumber(member.size, out);  // compressed
  if (far) AppendNumber(member.offset, out);
}

/// Of the archive, behind its directory of `size` bytes at `offset`.
void NpzWriter::AppendEnd(uint64_t offset, uint64_t size, mcap::Buffer& out) const {
  const bool zip64 = offset >= zip64_from_;
  if (zip64) {
    constexpr uint64_t kRest = 44;
    AppendNumber(uint32_t{0x0606'4B50}, out);
    AppendNumber(kRest, out);
    AppendNumber(kUnixVersion, out);
    AppendNumber(kZip64Version, out);
    AppendNumber(uint32_t{0}, out);  // disk
    AppendNumber(uint32_t{0}, out);  // of the directory
    AppendNumber(uint64_t{members_.size()}, out);
    AppendNumber(uint64_t{members_.size()}, out);
    AppendNumber(size, out);
    AppendNumber(offset, out);
    AppendNumber(uint32_t{0x0706'4B50}, out);
    AppendNumber(uint32_t{0}, out);  // disk
    AppendNumber(offset + size, out);
    AppendNumber(uint32_t{1}, out);  // disks
  }
  AppendNumber(uint32_t{0x0605'4B50}, out);
  AppendNumber(uint16_t{0}, out);  // disk
  AppendNumber(uint16_t{0}, out);  // of the directory
  AppendNumber(static_cast<uint16_t>(members_.size()), out);
  AppendNumber(static_cast<uint16_t>(members_.size()), out);
  AppendNumber(static_cast<uint32_t>(size), out);
  AppendNumber(zip64 ? kSaturated : static_cast<uint32_t>(offset), out);
  AppendNumber(uint16_t{0}, out);  // comment
}

Result<void> NpzWriter::Finish() {
  mcap::Buffer directory;
  for (Member& member : members_) {
    if (const auto flushed = FlushMember(member); !flushed) return flushed;
    if (member.data_written != member.array.bytes())
      return Error{ErrorCode::kInternal, "the array " + member.array.name + " is not full"};
    if (const auto written = WriteAt(member.offset, LocalHeader(member)); !written) return written;
    AppendDirectoryEntry(member, directory);
  }
  AppendEnd(end_, directory.size(), directory);
  if (const auto written = WriteAt(end_, directory); !written) return written;
  file_.close();
  if (!file_) return DiskError(place_->path());
  place_->Keep();
  return {};
}

}  // namespace taclink::command
