// The bytes of an MCAP log: opened, read in both orders, checked, scanned, and recovered.
#include <cstdint>
#include <cstdlib>
#include <memory>

#include "mcap/check.h"
#include "mcap/cursor.h"
#include "mcap/reader.h"
#include "mcap/recover.h"

namespace {

using namespace taclink::mcap;

constexpr Limits kLimits = {.record_bytes = 1 << 20, .chunk_bytes = 1 << 20, .open_bytes = 4 << 20};

void ReadInOrder(const Reader& reader, MessageOrder order) {
  MessageCursor cursor(reader, {.order = order});
  uint64_t last_ns = order == MessageOrder::kReverseLogTime ? UINT64_MAX : 0;
  while (true) {
    const auto message = cursor.Next();
    if (!message.ok() && message.error().code == taclink::ErrorCode::kEndOfData) return;
    if (!message.ok()) {
      if (message.error().message.empty()) std::abort();
      continue;
    }
    const bool backwards = order == MessageOrder::kReverseLogTime;
    if (backwards ? message->log_time_ns > last_ns : message->log_time_ns < last_ns) std::abort();
    last_ns = message->log_time_ns;
  }
}

void ReadAll(const Reader& reader) {
  ReadInOrder(reader, MessageOrder::kLogTime);
  ReadInOrder(reader, MessageOrder::kReverseLogTime);
  Buffer buffer;
  for (const AttachmentIndex& index : reader.attachments()) (void)reader.ReadAttachment(index, buffer);
  for (const MetadataIndex& index : reader.metadata()) (void)reader.ReadMetadata(index);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const Bytes bytes = std::as_bytes(std::span(data, size));
  const auto source = std::make_shared<const MemorySource>(bytes);
  if (const auto reader = Reader::Open(source, kLimits); reader.ok()) ReadAll(**reader);
  if (!Check(*source, kLimits).ok()) std::abort();

  BufferSink recovered;
  RecoverOptions options;
  options.scan = {.limits = kLimits, .keep_unverified = size % 2 == 1};
  const auto report = Recover(*source, recovered, options);
  if (!report.ok()) std::abort();
  const MemorySource again(recovered.bytes());
  const auto checked = Check(again);
  if (!checked.ok() || !checked->ok()) std::abort();
  if (report->written.message_count != report->scan.messages) std::abort();
  return 0;
}
