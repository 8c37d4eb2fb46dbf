// A real server on a free port, real clients over gRPC.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <thread>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

TEST(Stream, FramesOfTwoLinksReachTwoClientsInOrder) {
  TestServer server;
  auto a = server.Connect(), b = server.Connect();
  const auto all = Stream(a, Every());
  auto only_lower = Every(v1::DETAIL_FULL);
  only_lower.add_links("lower");
  const auto lower = Stream(b, only_lower);
  server.arm().Start();
  for (uint64_t i = 1; i <= 20; ++i) {
    for (size_t link = 0; link < 2; ++link) {
      server.script(link).Push(i, server.clock().MonotonicNs());
      v1::LinkFrame frame = NextOf(*all);
      while (frame.times().exposure_ns() == 0) frame = NextOf(*all);  // status before the first picture
      EXPECT_EQ(frame.link_index(), link);
      EXPECT_EQ(frame.link(), link == 0 ? "upper" : "lower");
      EXPECT_EQ(frame.sequence(), i);
    }
    v1::LinkFrame frame = NextOf(*lower);
    while (frame.times().exposure_ns() == 0) frame = NextOf(*lower);
    EXPECT_EQ(frame.link(), "lower");
    EXPECT_EQ(frame.sequence(), i);
    EXPECT_EQ(frame.status(), v1::LINK_STATUS_OK);
    const auto positions_m = client::Points(frame.positions_m());
    ASSERT_EQ(positions_m.size(), 256u);
    EXPECT_NEAR(positions_m[9][0], 1e-3 * static_cast<double>(i), 1e-8);
    EXPECT_NEAR(positions_m[9][1], 1e-3, 1e-8);
    ASSERT_EQ(frame.contacts_size(), 1);
    EXPECT_EQ(frame.contacts(0).id(), 7u);
    EXPECT_NEAR(frame.contacts(0).center_m().x(), 0.0365, 1e-9);
    EXPECT_NEAR(frame.contacts(0).normal_force_n(), 0.1 * static_cast<double>(i), 1e-9);
    EXPECT_NEAR(frame.contacts(0).area_m2(), 100e-6, 1e-12);
    EXPECT_NEAR(frame.pressure_pa(), 1e3 * static_cast<double>(i), 1e-6);
    EXPECT_NEAR(static_cast<double>(frame.displacement_covariances_m2(3)), 1e-6, 1e-12);
    EXPECT_TRUE(client::LatencyS(frame).has_value());
  }
}

// A client that does not read, as one behind a network that carries nothing.
TEST(Stream, HowLateFramesAreIsTold) {
  TestServer server;
  auto client = server.Connect();
  const auto reader = Stream(client, Every(v1::DETAIL_FULL));
  const auto publish = [&](uint64_t sequence) { server.Publish(0, sequence, server.clock().MonotonicNs()); };
  uint64_t sequence = 0;
  while (sequence < 200) publish(++sequence);
  server.clock().Advance(std::chrono::seconds(5));
  publish(++sequence);
  v1::LinkFrame frame;
  while (frame.sequence() < sequence) frame = NextOf(*reader);
  // The status follows within a second of the last one, with another frame.
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  while (reader->status().lateness_s() == 0 && std::chrono::steady_clock::now() < give_up) {
    publish(++sequence);
    NextOf(*reader);
  }
  EXPECT_GE(reader->status().lateness_s(), 5);
  EXPECT_GT(reader->status().links(0).frames_dropped(), 0u);
}

TEST(Stream, AClientLeavesOldFramesOut) {
  TestServer server;
  auto client = server.Connect();
  const auto reader = Stream(client, Every());
  const auto publish = [&](uint64_t sequence, std::chrono::hours age) {
    auto state = std::make_shared<LinkState>();
    state->sequence = sequence;
    state->times.exposure_utc_ns = SystemClock().UtcNs() - std::chrono::nanoseconds(age).count();
    server.arm().hub().Publish(0, std::move(state));
  };
  publish(1, std::chrono::hours(2));
  EXPECT_EQ(NextOf(*reader).sequence(), 1U) << "of any age";
  reader->SetMaxAge(std::chrono::hours(1));
  publish(2, std::chrono::hours(2));
  publish(3, std::chrono::hours(3));
  publish(4, std::chrono::hours(0));
  publish(5, std::chrono::hours(-2));  // the clock of this machine is behind
  EXPECT_EQ(NextOf(*reader).sequence(), 4U);
  EXPECT_EQ(NextOf(*reader).sequence(), 5U);
  EXPECT_EQ(reader->frames_too_old(), 2U);
  server.arm().hub().Publish(0, MakeState(6));  // without an exposure, as a lost link
  EXPECT_EQ(NextOf(*reader).sequence(), 6U);
}

TEST(Stream, GetArmTellsAllThereIsToDrawIt) {
  TestServer server;
  auto client = server.Connect();
  auto arm = client.GetArm();
  ASSERT_TRUE(arm.ok()) << arm.error().message;
  EXPECT_EQ(arm->links(0).status(), v1::LINK_STATUS_STARTING);
  server.arm().Start();
  const auto reader = Stream(client, Every());
  server.script(0).Push(1, server.clock().MonotonicNs());
  while (NextOf(*reader).times().exposure_ns() == 0) {
  }
  arm = client.GetArm();
  ASSERT_TRUE(arm.ok()) << arm.error().message;
  EXPECT_EQ(arm->name(), "test");
  EXPECT_FALSE(arm->server_version().empty());
  ASSERT_EQ(arm->links_size(), 2);
  EXPECT_EQ(arm->links(0).name(), "upper");
  EXPECT_EQ(arm->links(0).status(), v1::LINK_STATUS_OK);
  EXPECT_EQ(arm->links(0).statistics().contacts(), 1u);
  EXPECT_EQ(arm->links(0).source().description(), "fake");
  EXPECT_EQ(arm->links(0).source().kind(), v1::SOURCE_KIND_SIMULATED);
  EXPECT_NEAR(arm->links(1).base_from_link().translation_m().z(), 0.25, 1e-12);
  EXPECT_EQ(arm->links(1).base_from_link().rotation().w(), 1);
  const v1::LinkModel& model = arm->links(1).model();
  const v1::MarkerGrid& markers = model.markers();
  EXPECT_EQ(model.name(), "barrel");
  EXPECT_EQ(client::Points(markers.rest_positions_m()).size(), markers.paths() * markers.rings());
  EXPECT_EQ(markers.ring_z_m_size(), static_cast<int>(markers.rings()));
  EXPECT_EQ(model.profile_z_m_size(), model.profile_radius_m_size());
}

TEST(Stream, GetArmTellsHowTheCamerasDo) {
  TestServer server;
  server.script(1).Describe(
      {"pair", 640, 480, 30, {{"usb:1", "/dev/video0", "YUYV 640x480", ""}, {"usb:2", "", "", "unplugged"}}},
      {.pictures = {11, 12},
       .rate_hz = {29.5, 0},
       .lost = {1, 2},
       .damaged = {3, 4},
       .unpaired = {5, 6},
       .stamped_on_arrival = {7, 8},
       .skipped_pairs = 9,
       .info_changes = 1});
  auto client = server.Connect();
  const auto reader = Stream(client, Every());
  server.arm().Start();
  server.script(1).Push(1, server.clock().MonotonicNs());
  while (NextOf(*reader).times().exposure_ns() == 0) {
  }
  const auto arm = client.GetArm();
  ASSERT_TRUE(arm.ok()) << arm.error().message;
  EXPECT_TRUE(arm->links(0).cameras().empty());
  EXPECT_EQ(arm->links(1).statistics().pairs_skipped(), 9u);
  ASSERT_EQ(arm->links(1).cameras_size(), 2);
  const v1::Camera& top = arm->links(1).cameras(0);
  const v1::Camera& bottom = arm->links(1).cameras(1);
  EXPECT_EQ(top.name(), "top");
  EXPECT_EQ(top.configured(), "usb:1");
  EXPECT_EQ(top.device(), "/dev/video0");
  EXPECT_EQ(top.format(), "YUYV 640x480");
  EXPECT_EQ(top.rate_hz(), 29.5);
  EXPECT_EQ(bottom.name(), "bottom");
  EXPECT_EQ(bottom.trouble(), "unplugged");
  EXPECT_EQ(bottom.pictures(), 12u);
  EXPECT_EQ(bottom.lost(), 2u);
  EXPECT_EQ(bottom.damaged(), 4u);
  EXPECT_EQ(bottom.unpaired(), 6u);
  EXPECT_EQ(bottom.stamped_on_arrival(), 8u);
}

TEST(Stream, EachLevelOfDetailHoldsWhatItPromises) {
  TestServer server;
  auto client = server.Connect();
  const auto contacts = Stream(client, Every(v1::DETAIL_CONTACTS));
  const auto geometry = Stream(client, Every(v1::DETAIL_GEOMETRY));
  const auto full = Stream(client, Every(v1::DETAIL_FULL));
  server.Publish(0, 1);
  const v1::LinkFrame c = NextOf(*contacts), g = NextOf(*geometry), f = NextOf(*full);
  EXPECT_EQ(c.contacts_size(), 1);
  EXPECT_EQ(c.markers_seen(), 256u);
  EXPECT_TRUE(c.positions_m().empty());
  EXPECT_EQ(g.contacts_size(), 1);
  EXPECT_EQ(g.positions_m_size(), 3 * 256);
  EXPECT_TRUE(g.nodal_forces_n().empty());
  EXPECT_EQ(client::Points(f.positions_m()), client::Points(g.positions_m()));
  EXPECT_EQ(f.displacements_m_size(), 3 * 256);
  EXPECT_EQ(f.displacement_covariances_m2_size(), 6 * 256);
  EXPECT_EQ(f.nodal_forces_n_size(), 3 * 256);
  EXPECT_EQ(f.nodal_force_sigmas_n_size(), 256);
  EXPECT_EQ(f.marker_sources_size(), 256);
}

TEST(Stream, RateLimitLeavesOutFramesWithoutCountingThem) {
  TestServer server;
  auto client = server.Connect();
  auto request = Every();
  request.set_max_rate_hz(10);
  const auto limited = Stream(client, request);
  for (uint64_t i = 0; i < 90; ++i)
    server.Publish(0, i, 1'000'000'000 + static_cast<int64_t>(i) * 33'333'334);
  for (uint64_t i = 0; i < 30; ++i) EXPECT_EQ(NextOf(*limited).sequence(), 3 * i);
  server.Stop();
  EXPECT_FALSE(limited->Next(kForever).ok());
  ASSERT_EQ(limited->status().links_size(), 2);
  EXPECT_EQ(limited->status().links(0).frames_sent(), 30u);
  EXPECT_EQ(limited->status().links(0).frames_dropped(), 0u);
}

TEST(Stream, LatestBeginsWithTheNewest) {
  TestServer server;
  for (uint64_t i = 1; i <= 5; ++i) server.Publish(0, i);
  auto client = server.Connect();
  const auto latest = Stream(client, {});
  EXPECT_EQ(NextOf(*latest).sequence(), 5u);
}

// One client stops reading and then goes on; another reads all the time.
TEST(Stream, AClientThatStopsReadingHarmsOnlyItself) {
  TestServer server;
  auto a = server.Connect(), b = server.Connect(), c = server.Connect();
  const auto stopped = Stream(a, Every(v1::DETAIL_FULL));
  v1::StreamFramesRequest newest;
  newest.set_detail(v1::DETAIL_FULL);
  const auto stopped_latest = Stream(b, newest);
  const auto reading = Stream(c, Every());
  constexpr uint64_t kFrames = 4000;  // more than sockets and windows swallow
  int most_alive = 0;
  for (uint64_t i = 1; i <= kFrames; ++i) {
    server.Publish(0, i);
    ASSERT_EQ(NextOf(*reading).sequence(), i);
    most_alive = std::max(most_alive, server.states_alive());
  }
  // The stopped one's queue, the newest, and what is being sent.
  EXPECT_LE(most_alive, static_cast<int>(kQueueMessages) + 8);

  std::thread stop([&] { server.Stop(); });
  for (client::FrameReader* reader : {stopped.get(), stopped_latest.get()}) {
    uint64_t received = 0, last = 0;
    auto frame = reader->Next(kForever);
    for (; frame.ok(); frame = reader->Next(kForever)) {
      EXPECT_GT(frame->sequence(), last);
      last = frame->sequence();
      ++received;
    }
    EXPECT_EQ(frame.error().code, ErrorCode::kUnavailable);
    const v1::LinkStreamCounts counts = reader->status().links(0);
    EXPECT_EQ(counts.frames_sent(), received);
    EXPECT_GT(counts.frames_dropped(), 0u);
    EXPECT_LE(counts.frames_sent() + counts.frames_dropped(), kFrames);
  }
  stop.join();
}

TEST(Stream, TheGapIsToldWhileTheStreamGoesOn) {
  TestServer server;
  auto client = server.Connect();
  const auto reader = Stream(client, Every(v1::DETAIL_FULL));
  uint64_t published = 0, received = 0;
  while (published < 3000) server.Publish(0, ++published);
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  while (reader->status().links(0).frames_dropped() == 0 && std::chrono::steady_clock::now() < give_up) {
    if (!reader->Next(milliseconds(20)).ok()) server.Publish(0, ++published);
    ++received;
  }
  const v1::LinkStreamCounts counts = reader->status().links(0);
  EXPECT_GT(counts.frames_dropped(), 0u);
  EXPECT_GT(counts.frames_sent(), 0u);
  EXPECT_LE(counts.frames_sent(), received);
}

TEST(Stream, AnUnknownLinkIsRefusedWithTheKnownOnes) {
  TestServer server;
  auto client = server.Connect();
  const auto reader = client.StreamFrames(OfLinks({"upper", "elbow"}));
  ASSERT_FALSE(reader.ok());
  EXPECT_EQ(reader.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(reader.error().message, HasSubstr("'elbow'"));
  EXPECT_THAT(reader.error().message, HasSubstr("upper, lower"));
}

TEST(Stream, NonsenseIsRefused) {
  TestServer server;
  auto client = server.Connect();
  for (const double rate :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    v1::StreamFramesRequest request;
    request.set_max_rate_hz(rate);
    const auto reader = client.StreamFrames(request);
    ASSERT_FALSE(reader.ok());
    EXPECT_EQ(reader.error().code, ErrorCode::kInvalidArgument);
  }
  const auto huge = client.StreamFrames(OfLinks({std::string(100'000, 'x')}));
  ASSERT_FALSE(huge.ok());
  EXPECT_EQ(huge.error().code, ErrorCode::kResourceExhausted);
}

TEST(Stream, TooManyStreamsAreRefusedUntilOneEnds) {
  TestServer server;
  auto client = server.Connect();
  std::vector<std::unique_ptr<client::FrameReader>> readers;
  for (size_t i = 0; i < kMaxStreams; ++i) readers.push_back(Stream(client, {}));
  const auto refused = client.StreamFrames({});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kResourceExhausted);
  EXPECT_THAT(refused.error().message, HasSubstr("max_streams"));
  readers.pop_back();
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  while (true) {  // the server hears of the end a moment later
    const auto reader = client.StreamFrames({});
    if (reader.ok() || std::chrono::steady_clock::now() > give_up) {
      EXPECT_TRUE(reader.ok());
      break;
    }
  }
}

TEST(Stream, ShutdownIsToldToEveryStream) {
  TestServer server;
  auto client = server.Connect();
  const auto idle = Stream(client, {});
  const auto busy = Stream(client, Every());
  server.Publish(0, 1);
  EXPECT_EQ(NextOf(*busy).sequence(), 1u);
  std::thread stop([&] { server.Stop(); });
  for (client::FrameReader* reader : {idle.get(), busy.get()}) {
    auto frame = reader->Next(kForever);
    while (frame.ok()) frame = reader->Next(kForever);
    EXPECT_EQ(frame.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(frame.error().message, HasSubstr("the server ended the stream: server is shutting down"));
  }
  stop.join();
}

TEST(Stream, NextWaitsNoLongerThanItIsTold) {
  TestServer server;
  auto client = server.Connect();
  const auto reader = Stream(client, Every());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(reader->Next(milliseconds(1)).error().code, ErrorCode::kTimeout);
  server.Publish(1, 4);
  EXPECT_EQ(NextOf(*reader).sequence(), 4u);
}

TEST(Stream, CancelWakesAReader) {
  TestServer server;
  auto client = server.Connect();
  const auto reader = Stream(client, Every());
  std::thread cancel([&] { reader->Cancel(); });
  const auto frame = reader->Next(kForever);
  cancel.join();
  ASSERT_FALSE(frame.ok());
  EXPECT_EQ(frame.error().code, ErrorCode::kEndOfData);
}

TEST(Stream, NoServerSaysWhatToDo) {
  // A port of a server that has gone could be another program's by now.
  const auto client = client::Client::Connect("127.0.0.1:1", milliseconds(200));
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(client.error().message, HasSubstr("start taclinkd"));
}

TEST(Stream, AnAddressInUseIsRefused) {
  TestServer server;
  const auto second = RpcServer::Start(server.server().address(), server.arm(), {});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, HasSubstr("cannot listen"));
}

// gRPC would take the file from it.
TEST(Stream, AUnixSocketInUseStaysItsServers) {
  const std::string address = "unix:" + NewFolder("socket");
  TestServer server(TestLimits(), nullptr, {}, {}, address);
  const auto second = RpcServer::Start(address, server.arm(), {});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, HasSubstr("process " + std::to_string(getpid())));
  EXPECT_TRUE(server.Connect().GetArm().ok());
}

// As after a kill: a file that nobody listens at.
TEST(Stream, AUnixSocketThatWasLeftBehindIsTaken) {
  const std::string path = NewFolder("socket");
  sockaddr_un left{};
  left.sun_family = AF_UNIX;
  path.copy(left.sun_path, sizeof(left.sun_path) - 1);
  const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&left), sizeof(left)), 0);
  ::close(socket);
  TestServer server(TestLimits(), nullptr, {}, {}, "unix:" + path);
  EXPECT_TRUE(server.Connect().GetArm().ok());
}

}  // namespace
}  // namespace taclink::server
