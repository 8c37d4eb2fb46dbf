#include <gmock/gmock.h>

#include <thread>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

v1::CalibrateRequest CalibrationOf(const std::string& link, int pairs = 0) {
  v1::CalibrateRequest request;
  request.set_link(link);
  request.set_pairs(static_cast<uint32_t>(pairs));
  return request;
}

class CalibrateTest : public ::testing::Test {
 protected:
  void SetUp() override {
    server_.arm().Start();
    pictures_ = std::thread([this] {
      for (uint64_t i = 1; !done_; ++i) {
        server_.script(0).Push(i);
        server_.script(0).WaitUntilTaken();
      }
    });
  }
  void TearDown() override {
    done_ = true;
    pictures_.join();
    server_.arm().Stop();
  }

  TestServer server_;
  client::Client client_ = server_.Connect();
  std::atomic<bool> done_ = false;
  std::thread pictures_;
};

TEST_F(CalibrateTest, TellsProgressAndResult) {
  uint32_t last = 0;
  const auto result =
      client_.Calibrate(CalibrationOf("upper", 5), [&](const v1::CalibrationProgress& progress) {
        EXPECT_EQ(progress.pairs_wanted(), 5u);
        EXPECT_GT(progress.pairs_taken(), last);
        last = progress.pairs_taken();
        return true;
      });
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->markers_used(), 200u);
  EXPECT_DOUBLE_EQ(result->rms_px(), 0.25);
  EXPECT_DOUBLE_EQ(result->rmse_r_m(), 0.0005);
  EXPECT_EQ(result->file_text(), "text");
  EXPECT_EQ(result->saved_to(), "");
}

TEST_F(CalibrateTest, CanBeCancelledAndAskedAgain) {
  const auto cancelled = client_.Calibrate(CalibrationOf("upper", 300),
                                           [](const auto& progress) { return progress.pairs_taken() < 2; });
  ASSERT_FALSE(cancelled.ok());
  EXPECT_EQ(cancelled.error().code, ErrorCode::kEndOfData);
  auto again = client_.Calibrate(CalibrationOf("upper", 2));
  while (!again.ok() && again.error().code == ErrorCode::kFailedPrecondition) {  // still being cancelled
    again = client_.Calibrate(CalibrationOf("upper", 2));
  }
  EXPECT_TRUE(again.ok());
}

TEST_F(CalibrateTest, BadRequestsAreRefused) {
  const auto unknown = client_.Calibrate(CalibrationOf("elbow"));
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(unknown.error().message, HasSubstr("upper, lower"));
  for (const int pairs : {301, -1}) {
    const auto many = client_.Calibrate(CalibrationOf("upper", pairs));
    ASSERT_FALSE(many.ok());
    EXPECT_EQ(many.error().code, ErrorCode::kInvalidArgument);
  }
}

TEST_F(CalibrateTest, EndsWithTheServer) {
  std::thread stop;
  const auto result = client_.Calibrate(CalibrationOf("upper", 300), [&](const auto&) {
    if (!stop.joinable()) {
      done_ = true;  // no more pictures: it can't come to its own end
      stop = std::thread([&] { server_.Stop(); });
    }
    return true;
  });
  stop.join();
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(result.error().message, HasSubstr("shutting down"));
}

}  // namespace
}  // namespace taclink::server
