#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <thread>

#include "client/cpp/taclink/recordings.h"
#include "mcap/file_calls.h"
#include "mcap/scan.h"
#include "tests/integration/support.h"
#include "wire/log/topics.h"

namespace taclink::server {

enum class Call { kNone, kOpen, kWrite, kSync, kSyncFolder, kTruncate, kRename, kStatus, kAccess };

/// The system, of whose calls all of a kind fail for a while.
class FailingCalls final : public mcap::FileCalls {
 public:
  void Fail(Call call, int number) {
    number_ = number;
    failing_ = call;
  }
  int failed() const { return failed_; }
  /// How often the file was looked at, which a recording does in every round that is due.
  int looks() const { return looks_; }

  int Open(const std::string& path, int flags, mode_t mode) override {
    return Fails(Call::kOpen) ? -1 : FileCalls::Open(path, flags, mode);
  }
  ssize_t Write(int file, const iovec* pieces, int count) override {
    return Fails(Call::kWrite) || Fails(Call::kTruncate) ? -1 : FileCalls::Write(file, pieces, count);
  }
  int Sync(int file) override { return Fails(Call::kSync) ? -1 : FileCalls::Sync(file); }
  int SyncFolder(int folder) override {
    return Fails(Call::kSyncFolder) ? -1 : FileCalls::SyncFolder(folder);
  }
  int Truncate(int file, off_t length) override {
    return Fails(Call::kTruncate) ? -1 : FileCalls::Truncate(file, length);
  }
  int Rename(const std::string& from, const std::string& to) override {
    return Fails(Call::kRename) ? -1 : FileCalls::Rename(from, to);
  }
  int Status(int file, struct stat& out) override {
    ++looks_;
    return Fails(Call::kStatus) ? -1 : FileCalls::Status(file, out);
  }
  int Status(const std::string& path, struct stat& out) override {
    return Fails(Call::kStatus) ? -1 : FileCalls::Status(path, out);
  }
  int Access(const std::string& path, int mode) override {
    return Fails(Call::kAccess) ? -1 : FileCalls::Access(path, mode);
  }

 private:
  bool Fails(Call call) {
    if (failing_ != call) return false;
    ++failed_;
    errno = number_;
    return true;
  }

  std::atomic<Call> failing_ = Call::kNone;
  std::atomic<int> number_ = 0, failed_ = 0, looks_ = 0;
};

/// The frames of "upper" that a log has, whole or not; and what it tells of losses.
inline void AddFrames(const std::string& path, std::multiset<uint64_t>& frames) {
  struct Taker : mcap::ScanVisitor {
    Result<void> OnChannel(const mcap::Channel& channel) override {
      topics[channel.id] = channel.topic;
      return {};
    }
    Result<void> OnMessage(const mcap::Message& message, const mcap::MessagePlace&) override {
      const auto topic = wire::log::ParseTopic(topics[message.channel_id]);
      if (topic && topic->kind == wire::log::TopicKind::kFrame) frames->insert(message.sequence);
      return {};
    }
    std::map<uint16_t, std::string> topics;
    std::multiset<uint64_t>* frames = nullptr;
  } taker;
  taker.frames = &frames;
  const auto source = mcap::FileSource::Open(path);
  ASSERT_TRUE(source.ok()) << source.error().message;
  const auto scanned = mcap::Scan(**source, taker);
  EXPECT_TRUE(scanned.ok()) << path;
}

class RecordingFaultsTest : public ::testing::Test {
 protected:
  explicit RecordingFaultsTest(double split_s = 0) : split_s_(split_s) { server_.arm().events().Start(); }
  ~RecordingFaultsTest() override { std::filesystem::remove_all(folder_); }

  void Start() {
    const auto started = recordings_.Start(Uncompressed());
    ASSERT_TRUE(started.ok()) << started.error().message;
    Publish(10);
    WaitFor([this](const auto& status) { return status.frames() == published_; });
    Pass(2);
    WaitFor([](const auto& status) { return status.synced_utc_ns() != 0; });
  }
  static v1::StartRecordingRequest Uncompressed() {
    v1::StartRecordingRequest request;
    request.set_compression(v1::LOG_COMPRESSION_NONE);
    return request;
  }
  void Publish(int frames) {
    for (int i = 0; i < frames; ++i) server_.Publish(0, ++published_, server_.clock().MonotonicNs());
  }
  void Pass(double seconds) {
    server_.clock().Advance(std::chrono::milliseconds(static_cast<int64_t>(1e3 * seconds)));
  }
  template <typename F>
  v1::RecorderStatus WaitFor(const F& condition) {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    v1::RecorderStatus last;
    while (std::chrono::steady_clock::now() < give_up) {
      const auto status = recordings_.Status();
      if (status.ok() && condition(*status)) return *status;
      if (status.ok()) last = *status;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    ADD_FAILURE() << "not in time: " << client::Name(last.state()) << " " << last.trouble()
                  << "; before: " << last.last_trouble() << "; frames " << last.frames() << ", lost "
                  << last.frames_lost();
    return last;
  }
  // Time passes, and the recording has had a round since.
  void PassARound(double seconds = 0.6) {
    const int before = calls_.looks();
    Pass(seconds);
    WaitFor([&](const auto&) { return calls_.looks() > before; });
  }
  // Time passes until it is so.
  template <typename F>
  v1::RecorderStatus PassUntil(const F& condition) {
    return WaitFor([&](const auto& status) {
      if (condition(status)) return true;
      PassARound();
      return false;
    });
  }
  v1::RecorderStatus Stop() {
    const auto status = recordings_.Stop();
    EXPECT_TRUE(status.ok()) << status.error().message;
    return status.ok() ? *status : v1::RecorderStatus();
  }
  std::multiset<uint64_t> FramesIn(const std::string& folder) const {
    std::multiset<uint64_t> frames;
    for (const auto& file : std::filesystem::recursive_directory_iterator(folder)) {
      if (file.is_regular_file()) AddFrames(file.path(), frames);
    }
    return frames;
  }
  /// Events of operations that failed, with that in their text; waits for the first.
  int Told(const std::string& what) {
    WaitFor([&](const auto&) { return CountTold(what) > 0; });
    return CountTold(what);
  }
  int CountTold(const std::string& what) {
    int count = 0;
    EventCursor cursor(server_.arm().events().history(), 0, {}, [] {});
    while (true) {
      const auto step = cursor.Next();
      if (step.status) continue;
      if (!step.event) return count;
      const auto* detail = std::get_if<Operation>(&step.event->detail);
      if (detail != nullptr && !detail->accepted && detail->outcome.find(what) != std::string::npos) ++count;
    }
  }

  const double split_s_;
  const std::string folder_ = NewFolder("faults");
  FailingCalls calls_;
  TestServer server_{TestLimits(),  nullptr, {}, {.folder = folder_, .split_mb = 0, .split_s = split_s_},
                     "127.0.0.1:0", calls_};
  client::Client client_ = server_.Connect();
  client::Recordings recordings_ = client_.RecordingCalls();
  uint64_t published_ = 0;
};

}  // namespace taclink::server
