// The pressure inside a skin as clients tell it, up to the frames that clients get.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "server/pressure/pressure_sensor.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

class PressureTest : public ::testing::Test {
 protected:
  /// "upper" has its pressure from clients.
  PressureTest()
      : server_(TestLimits(), nullptr,
                [](size_t link, Clock& clock) -> std::unique_ptr<PressureSource> {
                  if (link != 0) return nullptr;
                  return std::make_unique<PressureSensor>(
                      "upper", nullptr, PressureSensorOptions{.origin = PressureOrigin::kClient}, clock);
                }),
        connection_(server_.Connect()),
        stub_(v1::TactileService::NewStub(server_.server().InProcessChannel())) {
    server_.arm().Start();
    reader_ = Stream(connection_, Every());
  }

  grpc::Status Tell(const std::string& link, std::vector<double> pressures_pa, int64_t utc_ns = 0) {
    grpc::ClientContext context;
    response_.Clear();
    const auto writer = stub_->UpdatePressure(&context, &response_);
    for (const double pressure_pa : pressures_pa) {
      v1::UpdatePressureRequest request;
      request.set_link(link);
      request.set_pressure_pa(pressure_pa);
      if (utc_ns != 0) request.set_utc_ns(utc_ns);
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }
  v1::LinkFrame FrameOf(size_t link) { return NextFrame(server_, *reader_, link, ++sequence_); }

  TestServer server_;
  client::Client connection_;
  std::unique_ptr<v1::TactileService::Stub> stub_;
  std::unique_ptr<client::FrameReader> reader_;
  v1::UpdatePressureResponse response_;
  uint64_t sequence_ = 0;
};

TEST_F(PressureTest, ReachesTheFramesAndGrowsStale) {
  auto frame = FrameOf(0);
  EXPECT_EQ(frame.pressure().origin(), v1::PRESSURE_ORIGIN_CLIENT);
  EXPECT_TRUE(frame.pressure().stale());
  EXPECT_FALSE(frame.pressure().assumed());
  EXPECT_THAT(frame.pressure().trouble(), HasSubstr("no reading yet"));
  EXPECT_FALSE(frame.has_pressure_pa());

  EXPECT_TRUE(Tell("upper", {1500, 2500}, server_.clock().UtcNs()).ok());
  EXPECT_EQ(response_.accepted(), 1u);
  EXPECT_EQ(response_.refused(), 1u) << "of the same time";
  server_.clock().Advance(std::chrono::milliseconds(250));
  frame = FrameOf(0);
  EXPECT_FALSE(frame.pressure().stale());
  EXPECT_NEAR(frame.pressure_pa(), 1500, 1e-6);
  EXPECT_NEAR(frame.pressure().age_s(), 0.25, 1e-9);

  server_.clock().Advance(std::chrono::seconds(1));
  frame = FrameOf(0);
  EXPECT_TRUE(frame.pressure().stale());
  EXPECT_FALSE(frame.has_pressure_pa());
  EXPECT_NEAR(frame.pressure().pressure_pa(), 1500, 1e-6) << "what was known last";

  EXPECT_TRUE(FrameOf(1).pressure().assumed());
}

TEST_F(PressureTest, BadReadingsAreRefusedWithTheReason) {
  EXPECT_EQ(Tell("lower", {1}).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(Tell("lower", {1}).error_message(), HasSubstr("{source: grpc}"));
  EXPECT_EQ(Tell("nobody", {1}).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(Tell("nobody", {1}).error_message(), HasSubstr("this arm has upper, lower"));
  EXPECT_THAT(Tell("", {1}).error_message(), HasSubstr("must name the link"));
  EXPECT_THAT(Tell("upper", {std::numeric_limits<double>::quiet_NaN()}).error_message(),
              HasSubstr("pressure_pa must be a finite number"));
  EXPECT_EQ(Tell("upper", {1e9}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(Tell("upper", {1}, 5).error_message(), HasSubstr("behind the server's clock"));
  EXPECT_TRUE(Tell("upper", {}).ok());
}

}  // namespace
}  // namespace taclink::server
