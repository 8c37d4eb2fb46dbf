#include "mcap/resync.h"

#include <algorithm>
#include <array>

namespace taclink::mcap {
namespace {

/// The least bytes of a record's content, by type from Header on.
constexpr std::array<uint64_t, 15> kLeastBytes = {8, 20, 14, 16, 22, 40, 6, 68, 36, 48, 46, 8, 20, 17, 4};

bool IsLongEnough(const RecordHeader& header) {
  if (!IsKnown(header.opcode)) return true;
  if (header.opcode == Opcode::kFooter) return header.length == kFooterBytes;
  return header.length >= kLeastBytes[static_cast<size_t>(header.opcode) - 1];
}

/// Sorts out most places quickly: a known type and less than 2^48 bytes, or the first byte of the magic.
bool MayBegin(const std::byte* bytes) {
  if (bytes[0] == kMagic[0]) return true;
  return IsKnown(static_cast<Opcode>(bytes[0])) && bytes[7] == std::byte{} && bytes[8] == std::byte{};
}

}  // namespace

bool Resync::IsMagic(uint64_t offset) {
  if (offset + kMagic.size() > source_.size()) return false;
  const auto bytes = look_.Get(offset, kMagic.size());
  return bytes.ok() && std::ranges::equal(*bytes, kMagic);
}

RecordHeader Resync::HeaderAt(uint64_t offset) {
  constexpr RecordHeader kNone{.opcode = {}, .length = kNoRecord};
  if (offset > source_.size() || source_.size() - offset < kRecordHeaderBytes) return kNone;
  const auto bytes = look_.Get(offset, kRecordHeaderBytes);
  if (!bytes) return kNone;
  const RecordHeader header = DecodeRecordHeader(*bytes);
  if (header.opcode == Opcode{} || !IsLongEnough(header)) return kNone;
  return header.length <= source_.size() - offset - kRecordHeaderBytes ? header : kNone;
}

bool Resync::CanGoOn(uint64_t offset) {
  constexpr int kChain = 2;
  return offset == source_.size() || IsMagic(offset) || IsChain(offset, kChain, true);
}

bool Resync::IsTorn(uint64_t offset) {
  constexpr uint64_t kPlausible = uint64_t{1} << 32;
  const uint64_t rest = source_.size() - offset;
  if (rest < kRecordHeaderBytes) return true;
  const auto bytes = look_.Get(offset, kRecordHeaderBytes);
  if (!bytes) return false;
  const RecordHeader header = DecodeRecordHeader(*bytes);
  return IsKnown(header.opcode) && header.length > rest - kRecordHeaderBytes && header.length < kPlausible;
}

bool Resync::IsChain(uint64_t offset, int records, bool unknown_too) {
  for (int i = 0; i < records; ++i) {
    if (i > 0 && (offset == source_.size() || IsMagic(offset))) return true;
    const RecordHeader header = HeaderAt(offset);
    if (header.length == kNoRecord) return i > 0 && IsTorn(offset);
    if (!IsKnown(header.opcode) && !unknown_too) return false;
    offset += kRecordHeaderBytes + header.length;
  }
  return true;
}

bool Resync::IsStart(uint64_t offset) {
  constexpr int kChain = 3;
  return IsMagic(offset) || IsChain(offset, kChain, false);
}

uint64_t Resync::Find(uint64_t offset) {
  const uint64_t size = source_.size();
  while (offset < size && size - offset >= kRecordHeaderBytes) {
    const auto count = static_cast<size_t>(std::min<uint64_t>(size - offset, Window::kBytes));
    const auto bytes = search_.Get(offset, count);
    const size_t starts = count - (kRecordHeaderBytes - 1);
    for (size_t i = 0; bytes.ok() && i < starts; ++i) {
      if (MayBegin(bytes->data() + i) && IsStart(offset + i)) return offset + i;
    }
    offset += starts;
  }
  for (; offset < size; ++offset) {
    if (IsMagic(offset)) return offset;
  }
  return size;
}

uint64_t Resync::RunEnd(uint64_t offset) {
  while (true) {
    const RecordHeader header = HeaderAt(offset);
    const bool in_run = header.opcode == Opcode::kSchema || header.opcode == Opcode::kChannel ||
                        header.opcode == Opcode::kMessage;
    if (header.length == kNoRecord || !in_run) return offset;
    offset += kRecordHeaderBytes + header.length;
  }
}

}  // namespace taclink::mcap
