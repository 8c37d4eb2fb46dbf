// The specific force of a link as clients tell it, up to the frames that clients get.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/attitude/client_attitude.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

class UpdateAttitudeTest : public ::testing::Test {
 protected:
  UpdateAttitudeTest()
      : connection_(server_.Connect()),
        stub_(v1::TactileService::NewStub(server_.server().InProcessChannel())) {
    server_.arm().Start();
    reader_ = Stream(connection_, Every());
  }

  grpc::Status Tell(const std::string& link, std::vector<Vec3> forces_mps2, double sigma_mps2 = 0) {
    grpc::ClientContext context;
    response_.Clear();
    const auto writer = stub_->UpdateAttitude(&context, &response_);
    for (const Vec3& mps2 : forces_mps2) {
      v1::UpdateAttitudeRequest request;
      request.set_link(link);
      request.mutable_specific_force_mps2()->set_x(mps2.x());
      request.mutable_specific_force_mps2()->set_y(mps2.y());
      request.mutable_specific_force_mps2()->set_z(mps2.z());
      request.set_sigma_mps2(sigma_mps2);
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
  v1::UpdateAttitudeResponse response_;
  uint64_t sequence_ = 0;
};

TEST_F(UpdateAttitudeTest, ReachesTheFramesAndGrowsStale) {
  EXPECT_THAT(FrameOf(0).specific_force().trouble(), HasSubstr("UpdateAttitude"));
  EXPECT_TRUE(Tell("upper", {{0, -9.5, 2}, {0, 0, 1}}, 0.5).ok());
  EXPECT_EQ(response_.accepted(), 1u);
  EXPECT_EQ(response_.refused(), 1u) << "of the same time";
  v1::LinkFrame frame = FrameOf(0);
  EXPECT_EQ(frame.specific_force().origin(), v1::ATTITUDE_ORIGIN_CLIENT);
  EXPECT_EQ(frame.specific_force().specific_force_mps2().y(), -9.5);
  ASSERT_EQ(frame.specific_force().covariance_m2_s4_size(), 6);
  EXPECT_NEAR(frame.specific_force().covariance_m2_s4(0), 0.25, 1e-12);
  server_.clock().Advance(std::chrono::seconds(1));
  EXPECT_THAT(FrameOf(0).specific_force().trouble(), HasSubstr("UpdateAttitude"));
  EXPECT_FALSE(FrameOf(1).has_specific_force()) << "it never moves";
}

TEST_F(UpdateAttitudeTest, BadReadingsAreRefusedWithTheReason) {
  EXPECT_EQ(Tell("lower", {{0, 0, -9.8}}).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(Tell("lower", {{0, 0, -9.8}}).error_message(), HasSubstr("{source: grpc}"));
  EXPECT_EQ(Tell("nobody", {{0, 0, -9.8}}).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(Tell("", {{0, 0, -9.8}}).error_message(), HasSubstr("must name the link"));
  EXPECT_EQ(Tell("upper", {{0, 0, -981}}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(Tell("upper", {{0, 0, -9.8}}, -1).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  grpc::ClientContext context;
  const auto writer = stub_->UpdateAttitude(&context, &response_);
  v1::UpdateAttitudeRequest nothing;
  nothing.set_link("upper");
  writer->Write(nothing);
  writer->WritesDone();
  EXPECT_THAT(writer->Finish().error_message(), HasSubstr("specific_force_mps2 is missing"));
}

}  // namespace
}  // namespace taclink::server
