// What the hub publishes, in logs made over the API.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "client/cpp/taclink/recordings.h"
#include "mcap/check.h"
#include "mcap/cursor.h"
#include "mcap/reader.h"
#include "taclink/v1/frame.pb.h"
#include "taclink/v1/log.pb.h"
#include "tests/integration/support.h"
#include "wire/log/topics.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using wire::log::TopicKind;

std::string Content(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

/// What a log holds of one kind.
template <typename T>
std::vector<T> Read(const std::string& path, TopicKind kind, const std::string& link = "") {
  std::vector<T> out;
  auto source = mcap::FileSource::Open(path);
  EXPECT_TRUE(source.ok()) << source.error().message;
  const std::shared_ptr<const mcap::ByteSource> bytes(std::move(*source));
  const auto report = mcap::Check(*bytes);
  EXPECT_TRUE(report.ok() && report->ok()) << report->findings[0].what;
  const auto reader = mcap::Reader::Open(bytes);
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  EXPECT_EQ((*reader)->summary_problem(), "");
  mcap::MessageCursor cursor(**reader, {.order = mcap::MessageOrder::kFile});
  while (const auto message = cursor.Next()) {
    const auto topic = wire::log::ParseTopic((*reader)->channels().at(message->channel_id).topic);
    EXPECT_TRUE(topic);
    if (topic->kind != kind || topic->link != link) continue;
    EXPECT_TRUE(
        out.emplace_back().ParseFromArray(message->data.data(), static_cast<int>(message->data.size())));
  }
  return out;
}

v1::StartRecordingRequest RecordingOf(const std::string& link, const std::string& name = "") {
  v1::StartRecordingRequest request;
  request.set_name(name);
  if (!link.empty()) request.add_links(link);
  return request;
}

v1::StartRecordingRequest Uncompressed() {
  v1::StartRecordingRequest request;
  request.set_compression(v1::LOG_COMPRESSION_NONE);
  return request;
}

constexpr int64_t kUtc = 1'700'000'000'000'000'000;

class RecordingTest : public ::testing::Test {
 protected:
  explicit RecordingTest(const RecordingConfig& config = {})
      : folder_(NewFolder("recording")), server_(TestLimits(), nullptr, {}, With(config)) {}
  ~RecordingTest() override { fs::remove_all(folder_); }
  RecordingConfig With(RecordingConfig config) const {
    config.folder = folder_;
    return config;
  }

  void Publish(size_t link, uint64_t first, uint64_t last) {
    for (uint64_t sequence = first; sequence <= last; ++sequence)
      server_.Publish(link, sequence, server_.clock().MonotonicNs());
  }
  v1::RecorderStatus Start(const v1::StartRecordingRequest& request = {}) {
    const auto status = recordings_.Start(request);
    EXPECT_TRUE(status.ok()) << status.error().message;
    return status.ok() ? *status : v1::RecorderStatus();
  }
  v1::RecorderStatus Stop() {
    const auto status = recordings_.Stop();
    EXPECT_TRUE(status.ok()) << status.error().message;
    return status.ok() ? *status : v1::RecorderStatus();
  }
  template <typename F>
  v1::RecorderStatus WaitFor(const F& condition) {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (std::chrono::steady_clock::now() < give_up) {
      const auto status = recordings_.Status();
      EXPECT_TRUE(status.ok()) << status.error().message;
      if (condition(*status)) return *status;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ADD_FAILURE() << "not in time";
    return {};
  }
  std::string PathOf(const std::string& log) const { return folder_ + "/" + log; }

  const std::string folder_;
  TestServer server_;
  client::Client client_ = server_.Connect();
  client::Recordings recordings_ = client_.RecordingCalls();
};

TEST_F(RecordingTest, HoldsEveryFrameAsItWasSent) {
  EXPECT_EQ(recordings_.Status()->state(), v1::RECORDER_STATE_IDLE);
  v1::StartRecordingRequest request;
  request.set_note("first");
  const auto started = Start(request);
  EXPECT_EQ(started.state(), v1::RECORDER_STATE_RECORDING);
  Publish(0, 1, 50);
  Publish(1, 100, 120);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.state(), v1::RECORDER_STATE_IDLE);
  EXPECT_EQ(stopped.frames(), 71u);
  EXPECT_EQ(stopped.frames_lost(), 0u);
  const auto frames = Read<v1::LinkFrame>(PathOf(stopped.log()), TopicKind::kFrame, "upper");
  ASSERT_EQ(frames.size(), 50u);
  const auto live = server_.arm().hub().Latest(0)->Encoded(Detail::kFull);
  EXPECT_EQ(frames.back().SerializeAsString(), *live);
  for (size_t i = 0; i < frames.size(); ++i) EXPECT_EQ(frames[i].sequence(), i + 1);
  EXPECT_EQ(Read<v1::LinkFrame>(PathOf(stopped.log()), TopicKind::kFrame, "lower").size(), 21u);
  EXPECT_GE(Read<v1::Arm>(PathOf(stopped.log()), TopicKind::kArm).size(), 1u);
  EXPECT_EQ(Read<v1::RecordingLoss>(PathOf(stopped.log()), TopicKind::kLosses).size(), 0u);

  const auto logs = recordings_.List();
  ASSERT_TRUE(logs.ok() && logs->logs_size() == 1);
  const v1::Log& log = logs->logs(0);
  EXPECT_EQ(log.frames(), 71u);
  EXPECT_THAT(log.links(), ::testing::UnorderedElementsAre("upper", "lower"));
  EXPECT_EQ(log.note(), "first");
  EXPECT_FALSE(log.open());
  EXPECT_EQ(log.problem(), "");
  EXPECT_EQ(log.bytes(), fs::file_size(PathOf(log.name())));
}

TEST_F(RecordingTest, ItsSummaryShowsWhenAndWhereItWasPressedMost) {
  Start();
  const int64_t begin_ns = server_.clock().MonotonicNs();
  // A frame each half second; the sequence is tenths of a newton.
  for (const uint64_t sequence : {1, 2, 9, 3}) {
    const int64_t now_ns = server_.clock().MonotonicNs();
    server_.Publish(0, sequence, now_ns, now_ns, kUtc + now_ns - begin_ns);
    server_.clock().Advance(std::chrono::milliseconds(500));
  }
  Stop();
  const auto logs = recordings_.List();
  ASSERT_TRUE(logs.ok() && logs->logs_size() == 1);
  ASSERT_TRUE(logs->logs(0).has_summary());
  const v1::LogSummary& summary = logs->logs(0).summary();
  EXPECT_THAT(summary.peak_magnitude_n(), ElementsAre(0.2F, 0.9F));
  const v1::StrongestContact& strongest = summary.strongest();
  EXPECT_EQ(strongest.link(), "upper");
  EXPECT_EQ(strongest.log_utc_ns(), server_.clock().UtcNs() - 1'000'000'000) << "the third of four";
  EXPECT_NEAR(strongest.magnitude_n(), 0.9, 1e-12);
  EXPECT_FALSE(strongest.is_ring_contact());
  EXPECT_NEAR(strongest.angle_rad(), 0, 1e-12);
  EXPECT_NEAR(strongest.z_m(), 0.009, 1e-12);
  EXPECT_NEAR(strongest.largest_displacement_m(), 0.009, 1e-12);
  ASSERT_EQ(strongest.displacements().size(), size_t{strongest.paths()} * strongest.rings());
  EXPECT_EQ(strongest.displacements().front(), '\xff');
}

TEST_F(RecordingTest, OnlyTheLinksAskedFor) {
  Start(RecordingOf("lower", "only"));
  Publish(0, 1, 5);
  Publish(1, 1, 3);
  const auto stopped = Stop();
  EXPECT_THAT(stopped.log(), HasSubstr("only-"));
  EXPECT_EQ(stopped.frames(), 3u);
}

TEST_F(RecordingTest, OrdersThatMakeNoSenseAreRefused) {
  EXPECT_EQ(recordings_.Stop().error().code, ErrorCode::kFailedPrecondition);
  EXPECT_EQ(recordings_.Start(RecordingOf("", "../x")).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(recordings_.Start(RecordingOf("nose")).error().code, ErrorCode::kNotFound);
  Start();
  const auto second = recordings_.Start({});
  EXPECT_EQ(second.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(second.error().message, HasSubstr("stop that first"));
  const v1::Log open = recordings_.List()->logs(0);
  EXPECT_TRUE(open.open());
  EXPECT_EQ(recordings_.Delete(open.name()).error().code, ErrorCode::kFailedPrecondition);
  const auto stopped = Stop();
  EXPECT_TRUE(recordings_.Delete(stopped.log()).ok());
  EXPECT_EQ(recordings_.Delete(stopped.log()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(recordings_.List()->logs_size(), 0);
}

TEST_F(RecordingTest, ALogIsDownloadedInPieces) {
  Start(Uncompressed());
  Publish(0, 1, 400);
  const std::string log = Stop().log();
  const std::string whole = Content(PathOf(log));
  ASSERT_GT(whole.size(), size_t{1} << 20);
  std::string got;
  const auto cut = recordings_.Download(log, 0, [&](std::string_view data, uint64_t offset, uint64_t size) {
    EXPECT_EQ(offset, got.size());
    EXPECT_EQ(size, whole.size());
    got += data;
    return false;
  });
  EXPECT_EQ(cut.error().code, ErrorCode::kEndOfData);
  EXPECT_LT(got.size(), whole.size());
  const auto rest = recordings_.Download(log, got.size(), [&](std::string_view data, uint64_t, uint64_t) {
    got += data;
    return true;
  });
  EXPECT_TRUE(rest.ok()) << rest.error().message;
  EXPECT_TRUE(got == whole);
  const auto none = [](auto, auto, auto) { return true; };
  EXPECT_TRUE(recordings_.Download(log, whole.size(), none).ok());
  EXPECT_EQ(recordings_.Download(log, whole.size() + 1, none).error().code, ErrorCode::kEndOfData);
  EXPECT_EQ(recordings_.Download("none.mcap", 0, none).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(recordings_.Download("../" + log, 0, none).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(RecordingTest, PicturesAreThoseOfTheFrames) {
  server_.arm().Start();
  auto request = RecordingOf("upper");
  request.set_pictures(true);
  Start(request);
  for (uint64_t i = 1; i <= 20; ++i) {
    server_.script(0).Push([i](StereoFrame& frame) -> Result<void> {
      frame.sequence = i;
      frame.times.exposure_monotonic_ns = frame.times.exposure_utc_ns = static_cast<int64_t>(i) * 1000;
      for (RawImage& image : frame.images) {
        image = {.format = PixelFormat::kGray8, .width_px = 8, .height_px = 2, .bytes = {}};
        image.bytes.assign(16, static_cast<uint8_t>(i));
        image.valid = true;
      }
      return {};
    });
    // By sequence: what the link reports of itself before its first frame counts as a frame of the log, too.
    WaitFor([&](const auto&) {
      const auto latest = server_.arm().hub().Latest(0);
      return latest != nullptr && latest->state().sequence >= i;
    });
  }
  server_.arm().Stop();  // the last one is with all subscribers then
  const std::string path = PathOf(Stop().log());
  EXPECT_FALSE(server_.arm().hub().WantsPictures(0)) << "nobody reads them any more";
  auto source = mcap::FileSource::Open(path);
  const auto reader = mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(*source)));
  mcap::MessageCursor cursor(**reader, {});
  int pictures = 0;
  while (const auto message = cursor.Next()) {
    const auto topic = wire::log::ParseTopic((*reader)->channels().at(message->channel_id).topic);
    if (topic->kind == TopicKind::kPicture) {
      ++pictures;
      EXPECT_EQ(message->publish_time_ns, 1000u * message->sequence);
      const auto last = std::to_integer<uint8_t>(message->data.back());
      EXPECT_EQ(last, message->sequence);
    }
  }
  EXPECT_EQ(pictures, 40);
}

TEST_F(RecordingTest, ItsStatusIsToldAlsoWhileFramesComeFasterThanTheyAreWritten) {
  Start();
  std::atomic<uint64_t> published = 0;
  std::jthread flood([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) Publish(0, published + 1, published + 1), ++published;
  });
  const uint64_t first = WaitFor([](const auto& status) { return status.frames() > 0; }).frames();
  server_.clock().Advance(std::chrono::seconds(2));
  EXPECT_NE(WaitFor([](const auto& status) { return status.synced_utc_ns() != 0; }).synced_utc_ns(), 0);
  const auto behind = WaitFor([first](const auto& status) {
    return status.frames() > first && status.state() == v1::RECORDER_STATE_TROUBLE;
  });
  EXPECT_GT(behind.frames_lost(), 0u);
  EXPECT_THAT(behind.trouble(), HasSubstr("recording.queue_mb"));
  flood.request_stop();
  flood.join();
  WaitFor([this](const auto& status) {
    server_.clock().Advance(std::chrono::seconds(2));
    return status.state() == v1::RECORDER_STATE_RECORDING;
  });
  const auto stopped = Stop();
  EXPECT_EQ(Read<v1::LinkFrame>(PathOf(stopped.log()), TopicKind::kFrame, "upper").size(), stopped.frames());
  EXPECT_EQ(stopped.frames() + stopped.frames_lost(), published);
}

class SplitTest : public RecordingTest {
 protected:
  SplitTest() : RecordingTest({.split_mb = 0, .split_s = 10, .quota_mb = 0}) {}
};

TEST_F(SplitTest, ALogIsClosedAndTheNextBegun) {
  Start();
  Publish(0, 1, 5);
  WaitFor([](const auto& status) { return status.frames() == 5; });
  server_.clock().Advance(std::chrono::seconds(11));
  WaitFor([](const auto& status) { return status.logs() == 2; });
  Publish(0, 6, 8);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), 8u);
  const auto logs = recordings_.List();
  ASSERT_EQ(logs->logs_size(), 2);
  EXPECT_EQ(logs->logs(0).frames(), 5u);
  EXPECT_EQ(logs->logs(1).frames(), 3u);
  for (const auto& log : logs->logs())
    EXPECT_GE(Read<v1::Arm>(PathOf(log.name()), TopicKind::kArm).size(), 1u);
}

TEST_F(RecordingTest, WhenTheClockIsSetAnotherLogBeginsAndEachKeepsItsTimeLine) {
  constexpr std::chrono::hours kDay{24};
  Start();
  Publish(0, 1, 5);
  WaitFor([](const auto& status) { return status.frames() == 5; });
  server_.clock().StepUtc(-kDay);
  server_.clock().Advance(std::chrono::seconds(1));
  WaitFor([](const auto& status) { return status.logs() == 2; });
  Publish(0, 6, 8);
  server_.clock().Advance(std::chrono::seconds(2));
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), 8u);
  EXPECT_EQ(stopped.frames_lost(), 0u);
  const auto logs = recordings_.List();
  ASSERT_EQ(logs->logs_size(), 2);
  constexpr int64_t kMinuteNs = 60'000'000'000;
  for (const auto& log : logs->logs())
    EXPECT_LT(log.end_utc_ns() - log.start_utc_ns(), kMinuteNs) << log.name();
  EXPECT_EQ(logs->logs(0).frames(), 5u) << "in the order of recording, although the clock went back";
  EXPECT_EQ(logs->logs(1).frames(), 3u);
  EXPECT_LT(logs->logs(1).end_utc_ns(), logs->logs(0).start_utc_ns());
}

class QuotaTest : public RecordingTest {
 protected:
  QuotaTest() : RecordingTest({.split_mb = 0, .split_s = 0, .quota_mb = 0.001}) {}
};

TEST_F(QuotaTest, EachDeletionIsAnEventAndTheNewestStay) {
  server_.arm().events().Start();
  Start();
  Publish(0, 1, 5);
  WaitFor([](const auto& status) { return status.frames() == 5; });
  server_.clock().StepUtc(-std::chrono::hours(24));
  server_.clock().Advance(std::chrono::seconds(1));
  WaitFor([](const auto& status) { return status.logs() == 2; });
  const std::string newest = recordings_.Status()->log();
  server_.clock().Advance(std::chrono::seconds(20));
  const auto deletion = [this] {
    EventCursor cursor(server_.arm().events().history(), 0, {}, [] {});
    while (true) {
      const auto step = cursor.Next();
      if (step.status) continue;
      if (!step.event) return std::string();
      const auto* detail = std::get_if<Operation>(&step.event->detail);
      if (detail != nullptr && detail->values.contains("logs_deleted")) return detail->outcome;
    }
  };
  WaitFor([&](const auto&) { return !deletion().empty(); });
  EXPECT_THAT(deletion(), ::testing::HasSubstr("recording.quota_mb"));
  EXPECT_THAT(deletion(), ::testing::Not(::testing::HasSubstr(newest)));
  Stop();
}

/// Files of this process can't grow beyond a limit: as a full disk, but for the error's name.
class FileLimit {
 public:
  explicit FileLimit(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileLimit() { ::setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_{};
};

TEST_F(RecordingTest, WhatTheDiskDoesNotTakeIsNamed) {
  Start(Uncompressed());
  Publish(0, 1, 10);
  WaitFor([](const auto& status) { return status.frames() == 10; });
  server_.clock().Advance(std::chrono::seconds(2));
  const auto synced = WaitFor([](const auto& status) { return status.synced_utc_ns() != 0; });
  {
    const FileLimit full(fs::file_size(PathOf(synced.log()) + ".part"));
    Publish(0, 11, 14);
    server_.clock().Advance(std::chrono::seconds(2));
    const auto trouble =
        WaitFor([](const auto& status) { return status.state() == v1::RECORDER_STATE_TROUBLE; });
    EXPECT_THAT(trouble.trouble(), HasSubstr(synced.log()));
    EXPECT_EQ(WaitFor([](const auto& status) { return status.frames_lost() == 4; }).frames_lost(), 4u);
  }
  server_.clock().Advance(std::chrono::seconds(2));
  WaitFor([](const auto& status) { return status.state() == v1::RECORDER_STATE_RECORDING; });
  Publish(0, 15, 20);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames_lost(), 4u);
  EXPECT_EQ(stopped.frames(), 16u);
  const auto frames = Read<v1::LinkFrame>(PathOf(stopped.log()), TopicKind::kFrame, "upper");
  EXPECT_EQ(frames.size(), 16u);
  const auto losses = Read<v1::RecordingLoss>(PathOf(stopped.log()), TopicKind::kLosses);
  ASSERT_EQ(losses.size(), 1u);
  EXPECT_EQ(losses[0].link(), "upper");
  EXPECT_EQ(losses[0].count(), 4u);
  EXPECT_EQ(losses[0].after_sequence(), 10u);
  EXPECT_EQ(losses[0].before_sequence(), 15u);
  EXPECT_EQ(losses[0].reason(), v1::LOSS_REASON_DISK);
}

}  // namespace
}  // namespace taclink::server
