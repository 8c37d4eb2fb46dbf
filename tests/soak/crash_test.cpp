// A server that records six links with their pictures is killed at random moments: what it had synced is in
// the log that is made whole. TACLINK_CRASHES: how often (5).
#include <gtest/gtest.h>
#include <signal.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <set>
#include <thread>

#include "client/command/server_load.h"
#include "client/taclink/recordings.h"
#include "server/recording/log_folder.h"
#include "taclink/v1/frame.pb.h"
#include "tests/support/process.h"
#include "wire/log/topics.h"
#include "wire/mcap/check.h"
#include "wire/mcap/cursor.h"
#include "wire/mcap/reader.h"

namespace taclink {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using wire::log::TopicKind;

constexpr int kLinks = 6;
constexpr size_t kBegin = 100;  // frames after which a kill may come
// At most, from the stamp of a frame to the recorder's queue.
constexpr int64_t kHandOverNs = 200'000'000;

int Crashes() {
  const char* const text = std::getenv("TACLINK_CRASHES");
  return text == nullptr ? 5 : std::max(1, std::atoi(text));
}

class CrashTest : public ::testing::Test {
 protected:
  CrashTest()
      : root_(::testing::TempDir() + "crash." + std::to_string(::getpid())), folder_(root_ + "/logs") {
    fs::create_directories(root_ + "/pictures");
    const auto pictures = command::RenderLoadPictures(root_ + "/pictures");
    EXPECT_TRUE(pictures.ok());
    std::ofstream(root_ + "/arm.yaml")
        << command::LoadConfigText(*pictures, kLinks, 30, true) << "recording: {folder: \"" << folder_.path()
        << "\", at_start: true, pictures: true, sync_s: 0.2}\n";
  }
  ~CrashTest() override { fs::remove_all(root_); }

  using FrameId = std::pair<std::string, uint64_t>;  // link, sequence
  struct Killed {
    std::string log;
    int64_t synced_utc_ns = 0;
    std::map<FrameId, int64_t> seen;  // by a client, with when they were published
  };
  // Kills a server some time after its links have begun.
  Killed Crash(std::chrono::milliseconds after) const {
    testing::Process server({TACLINKD, "--config", root_ + "/arm.yaml", "--listen", "127.0.0.1:0",
                             "--http-listen", "", "--log-format", "text"});
    const auto line = server.ReadUntil("listening on ", 60s, true);
    EXPECT_TRUE(line);
    const std::string address = line->substr(line->rfind(' ') + 1);
    auto client = client::Client::Connect(address, 60s);
    EXPECT_TRUE(client.ok()) << client.error().message;
    client::Recordings recordings = client->RecordingCalls();
    const auto frames = client->StreamFrames({.delivery = client::Delivery::kEvery});
    EXPECT_TRUE(frames.ok()) << frames.error().message;
    Killed killed;
    std::optional<std::chrono::steady_clock::time_point> end;
    while (!end || std::chrono::steady_clock::now() < *end) {
      for (int i = 0; i < 10; ++i) {
        const auto frame = (*frames)->Next(10ms);
        if (!frame || frame->times.exposure_ns == 0) continue;
        const client::FrameTimes& times = frame->times;
        killed.seen[{frame->link, frame->sequence}] =
            times.exposure_utc_ns + (times.published_ns - times.exposure_ns);
      }
      const auto status = recordings.Status();
      if (!status) {
        ADD_FAILURE() << status.error().message;
        break;
      }
      killed.log = status->log;
      killed.synced_utc_ns = status->synced_utc_ns;
      if (!end && killed.seen.size() > kBegin && status->synced_utc_ns != 0)
        end = std::chrono::steady_clock::now() + after;
    }
    server.Signal(SIGKILL);
    server.Wait(10s);
    return killed;
  }

  static void ExpectComplete(const std::string& path, const Killed& killed) {
    auto source = mcap::FileSource::Open(path);
    ASSERT_TRUE(source.ok()) << source.error().message;
    const std::shared_ptr<const mcap::ByteSource> bytes(std::move(*source));
    const auto report = mcap::Check(*bytes);
    ASSERT_TRUE(report.ok());
    EXPECT_TRUE(report->ok()) << report->findings[0].what;
    const auto reader = mcap::Reader::Open(bytes);
    ASSERT_TRUE(reader.ok());
    std::set<FrameId> recorded;
    std::map<FrameId, int> pictures;
    mcap::MessageCursor cursor(**reader, {.order = mcap::MessageOrder::kFile});
    while (true) {
      const auto message = cursor.Next();
      if (!message) {
        EXPECT_EQ(message.error().code, ErrorCode::kEndOfData) << message.error().message;
        break;
      }
      const auto topic = wire::log::ParseTopic((*reader)->channels().at(message->channel_id).topic);
      ASSERT_TRUE(topic);
      EXPECT_NE(topic->kind, TopicKind::kLosses) << "the recorder was too slow";
      if (topic->kind == TopicKind::kPicture) ++pictures[{topic->link, message->sequence}];
      if (topic->kind != TopicKind::kFrame) continue;
      v1::LinkFrame frame;
      ASSERT_TRUE(frame.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
      if (frame.times().exposure_ns() == 0) continue;
      recorded.insert({topic->link, frame.sequence()});
      EXPECT_EQ((pictures[{topic->link, frame.sequence()}]), 2);
    }
    int synced = 0;
    for (const auto& [id, utc_ns] : killed.seen) {
      if (utc_ns > killed.synced_utc_ns - kHandOverNs) continue;
      ++synced;
      EXPECT_TRUE(recorded.contains(id)) << id.first << " frame " << id.second << " is lost";
    }
    EXPECT_GT(synced, 0);
    std::printf("%d frames were synced, %zu are in the log\n", synced, recorded.size());
  }

  const std::string root_;
  const server::LogFolder folder_;
};

TEST_F(CrashTest, WhatWasSyncedIsNotLost) {
  std::mt19937 random(1);
  const int crashes = Crashes();
  for (int i = 0; i < crashes; ++i) {
    SCOPED_TRACE("crash " + std::to_string(i));
    const Killed killed = Crash(std::chrono::milliseconds(random() % 1500));
    ASSERT_NE(killed.synced_utc_ns, 0);
    const auto unfinished = folder_.Unfinished();
    ASSERT_EQ(unfinished.size(), 1u);
    EXPECT_EQ(unfinished[0].name, killed.log);
    const std::string told = folder_.Recover(killed.log);
    ASSERT_TRUE(folder_.Unfinished().empty()) << told;
    ExpectComplete(folder_.FinalPath(killed.log), killed);
    ASSERT_TRUE(folder_.Delete(killed.log).ok());
  }
}

TEST_F(CrashTest, TheNextServerMakesTheLogWhole) {
  const Killed first = Crash(100ms);
  const auto give_up = std::chrono::steady_clock::now() + 120s;
  testing::Process server({TACLINKD, "--config", root_ + "/arm.yaml", "--listen", "127.0.0.1:0",
                           "--http-listen", "", "--log-format", "text"});
  EXPECT_TRUE(server.ReadUntil("made whole", 60s, true));
  while (!fs::exists(folder_.FinalPath(first.log)) && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(10ms);
  ExpectComplete(folder_.FinalPath(first.log), first);
  EXPECT_FALSE(fs::exists(folder_.PartPath(first.log)));
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(60s).exit_code, 0);
  EXPECT_TRUE(folder_.Unfinished().empty());
}

}  // namespace
}  // namespace taclink
