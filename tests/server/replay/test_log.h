#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>

#include "mcap/byte_sink.h"
#include "mcap/reader.h"
#include "taclink/v1/events.pb.h"
#include "taclink/v1/frame.pb.h"
#include "tests/support/times.h"
#include "wire/log/log_writer.h"

namespace taclink::server {

inline constexpr int64_t kT0 = 1'800'000'000'000'000'000;  // of each log's first message

/// Counts what is read of it.
class CountingSource final : public mcap::ByteSource {
 public:
  explicit CountingSource(mcap::Buffer bytes) : bytes_(std::move(bytes)), memory_(bytes_) {}
  uint64_t size() const override { return memory_.size(); }
  Result<void> Read(uint64_t offset, std::span<std::byte> out) const override {
    read_ += out.size();
    return memory_.Read(offset, out);
  }
  uint64_t bytes_read() const { return read_; }

 private:
  const mcap::Buffer bytes_;
  const mcap::MemorySource memory_;
  mutable uint64_t read_ = 0;
};

/// Makes a log in memory.
class TestLog {
 public:
  explicit TestLog(mcap::WriterOptions options = {.chunk_bytes = 4000}) {
    auto writer = wire::log::LogWriter::Create(sink_, std::move(options));
    EXPECT_TRUE(writer.ok()) << writer.error().message;
    writer_ = std::move(*writer);
  }

  void Frame(const std::string& link, uint64_t sequence, int64_t utc_ns, size_t padding = 0) {
    v1::LinkFrame frame;
    frame.set_link(link);
    frame.set_sequence(sequence);
    frame.set_status_reason(std::string(padding, 'x'));
    Expect(writer_->Write({.kind = wire::log::TopicKind::kFrame, .link = link}, frame,
                          {.log_utc_ns = utc_ns, .sequence = sequence}));
  }
  void Event(uint64_t sequence, int64_t utc_ns) {
    v1::Event event;
    event.set_sequence(sequence);
    Expect(writer_->Write({.kind = wire::log::TopicKind::kEvents}, event, {.log_utc_ns = utc_ns}));
  }
  /// So many frames of "a", 10 ms apart: frame i (from 0) at kT0 + i * 10 ms.
  TestLog& Frames(int count) {
    for (int i = 0; i < count; ++i) Frame("a", static_cast<uint64_t>(i), kT0 + i * 10 * kMs);
    return *this;
  }

  mcap::Buffer Bytes() {
    Expect(writer_->mcap().Close());
    return sink_.bytes();
  }

 private:
  static void Expect(const Result<void>& done) { EXPECT_TRUE(done.ok()) << done.error().message; }

  mcap::BufferSink sink_;
  std::unique_ptr<wire::log::LogWriter> writer_;
};

inline std::shared_ptr<const mcap::Reader> Open(std::shared_ptr<const mcap::ByteSource> source) {
  auto reader = mcap::Reader::Open(std::move(source));
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  return std::move(*reader);
}
inline std::shared_ptr<const mcap::Reader> Open(mcap::Buffer bytes) {
  return Open(std::make_shared<const CountingSource>(std::move(bytes)));
}

}  // namespace taclink::server
