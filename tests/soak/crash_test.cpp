// A server that records two links with their pictures is killed at random moments: what it had synced is in
// the log that is made whole. TACLINK_CRASHES: how often (5). Nothing is judged by time, so that neither a
// slow machine nor a slow disk makes a difference.
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

#include "client/cpp/taclink/client.h"
#include "client/cpp/taclink/recordings.h"
#include "mcap/check.h"
#include "mcap/cursor.h"
#include "mcap/reader.h"
#include "server/recording/log_folder.h"
#include "taclink/v1/frame.pb.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"
#include "wire/log/topics.h"

namespace taclink {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using wire::log::TopicKind;

// Ten frames a second in all: little enough for the recorder of any machine to lose none.
constexpr const char* kScene =
    "taclink_scene: 1\nname: crash\nmodel: cylinder\nframe_rate_hz: 5\nduration_s: 7200\n";
constexpr int kFramePeriodMs = 200;
constexpr size_t kBegin = 10;  // frames after which a kill may come
constexpr auto kPatience = 120s;

int Crashes() {
  const char* const text = std::getenv("TACLINK_CRASHES");
  return text == nullptr ? 5 : std::max(1, std::atoi(text));
}

class CrashTest : public ::testing::Test {
 protected:
  CrashTest() {
    std::ofstream(root_ + "/scene.yaml") << kScene;
    std::ofstream(root_ + "/arm.yaml")
        << "taclink_config: 1\narm:\n  name: crash\n  links:\n"
        << "    - {name: a, model: cylinder, source: simulated, scene: scene.yaml}\n"
        << "    - {name: b, model: cylinder, source: simulated, scene: scene.yaml}\n"
        << "recording: {folder: \"" << folder_.path() << "\", at_start: true, pictures: true, sync_s: 0.2}\n";
  }

  using FrameId = std::pair<std::string, uint64_t>;  // link, sequence
  struct Killed {
    std::string log;
    uint64_t synced = 0;     // frames of both links that were surely synced; the log begins with them
    std::set<FrameId> seen;  // by a client
  };
  testing::Process Serve() const {
    return testing::Process({testing::kTaclinkd, "--config", root_ + "/arm.yaml", "--listen", "127.0.0.1:0",
                             "--http-listen", "", "--log-format", "text"});
  }
  // Kills a server after `frames` frames, within the next one's period.
  Killed Crash(size_t frames, std::chrono::milliseconds within_period) const {
    Killed killed;
    testing::Process server = Serve();
    const auto line = server.ReadUntil("listening on ", kPatience, true);
    if (!line) {
      ADD_FAILURE() << "the server does not listen";
      return killed;
    }
    auto client = client::Client::Connect(line->substr(line->rfind(' ') + 1), kPatience);
    EXPECT_TRUE(client.ok()) << client.error().message;
    client::Recordings recordings = client->RecordingCalls();
    v1::StreamFramesRequest every;
    every.set_delivery(v1::DELIVERY_EVERY);
    const auto stream = client->StreamFrames(every, kPatience);
    EXPECT_TRUE(stream.ok()) << stream.error().message;
    v1::RecorderStatus before;
    while (killed.seen.size() < frames || killed.synced < frames) {
      const auto frame = (*stream)->Next(kPatience);
      const auto status = recordings.Status();
      if (!frame || !status) {
        ADD_FAILURE() << (frame ? status.error() : frame.error()).message;
        break;
      }
      if (frame->times().exposure_ns() != 0) killed.seen.emplace(frame->link(), frame->sequence());
      // One thread writes and syncs in turn, so the next sync covers all that a status says was written.
      if (status->synced_utc_ns() != before.synced_utc_ns()) killed.synced = before.frames();
      before = *status;
    }
    killed.log = before.log();
    // This waits for nothing. It lets the kill come at any point of the work on a frame.
    std::this_thread::sleep_for(within_period);
    server.Signal(SIGKILL);
    server.Wait(kPatience);
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
    uint64_t recorded = 0;
    std::set<FrameId> exposed;                // recorded
    std::map<std::string, uint64_t> last_of;  // sequence, by link
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
      ++recorded;
      if (frame.times().exposure_ns() == 0) continue;
      exposed.insert({topic->link, frame.sequence()});
      last_of[topic->link] = frame.sequence();
      EXPECT_EQ((pictures[{topic->link, frame.sequence()}]), 2);
    }
    EXPECT_GE(recorded, killed.synced) << "synced frames are lost";
    for (const auto& [link, sequence] : killed.seen) {
      EXPECT_TRUE(sequence > last_of[link] || exposed.contains({link, sequence}))
          << link << " frame " << sequence << " is lost";
    }
    std::printf("%d frames were synced, %d are in the log\n", static_cast<int>(killed.synced),
                static_cast<int>(recorded));
  }

  const TemporaryFolder scratch_{"crash"};
  const std::string root_ = scratch_.path();
  const server::LogFolder folder_{root_ + "/logs"};
};

TEST_F(CrashTest, WhatWasSyncedIsNotLost) {
  std::mt19937 random(1);
  const int crashes = Crashes();
  for (int i = 0; i < crashes; ++i) {
    SCOPED_TRACE("crash " + std::to_string(i));
    const size_t frames = kBegin + random() % 15;
    const Killed killed = Crash(frames, std::chrono::milliseconds(random() % kFramePeriodMs));
    ASSERT_NE(killed.synced, 0u);
    const auto unfinished = folder_.Unfinished();
    ASSERT_EQ(unfinished.size(), 1u);
    EXPECT_EQ(unfinished[0].name, killed.log);
    const std::string told = folder_.Recover(killed.log).value_or("it is locked");
    ASSERT_TRUE(folder_.Unfinished().empty()) << told;
    ExpectComplete(folder_.FinalPath(killed.log), killed);
    ASSERT_TRUE(folder_.Delete(killed.log).ok());
  }
}

TEST_F(CrashTest, TheNextServerMakesTheLogWhole) {
  const Killed first = Crash(kBegin, 100ms);
  testing::Process server = Serve();
  EXPECT_TRUE(server.ReadUntil("made whole", kPatience, true));
  const auto give_up = std::chrono::steady_clock::now() + kPatience;
  while (!fs::exists(folder_.FinalPath(first.log)) && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(10ms);
  ExpectComplete(folder_.FinalPath(first.log), first);
  EXPECT_FALSE(fs::exists(folder_.PartPath(first.log)));
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(kPatience).exit_code, 0);
  EXPECT_TRUE(folder_.Unfinished().empty());
}

}  // namespace
}  // namespace taclink
