#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "sensing/core/thread_start.h"
#include "sensing/model/model_file.h"
#include "server/recording/recorder.h"
#include "tests/server/support.h"
#include "tests/support/temporary_folder.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

class RecordingStartTest : public ::testing::Test {
 protected:
  RecordingStartTest() {
    std::vector<LinkParts> links;
    links.push_back({.description = {.name = "upper", .model = *LoadLinkModel("cylinder")},
                     .source = std::make_unique<FakeSource>(std::make_shared<SourceScript>()),
                     .processor = std::make_unique<FakeProcessor>([](const StereoFrame&, LinkState&) {})});
    arm_ = std::make_unique<Arm>(
        "test", std::move(links), [](size_t, const LinkState&, Detail) { return std::string(); }, clock_);
    recorder_ = std::make_unique<Recorder>(*arm_, RecordingConfig{.folder = folder_.path()}, LogPreamble());
  }

  static v1::StartRecordingRequest WithPictures() {
    v1::StartRecordingRequest request;
    request.set_pictures(true);
    return request;
  }
  size_t Logs() const { return recorder_->folder().List().size(); }

  const TemporaryFolder folder_;
  ManualClock clock_;
  std::unique_ptr<Arm> arm_;
  std::unique_ptr<Recorder> recorder_;
};

TEST_F(RecordingStartTest, WithoutAThreadTheCallIsRefusedAndNothingIsLeft) {
  {
    const ThreadShortage shortage("recording");
    const auto refused = recorder_->Start(WithPictures(), "test");
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kResourceExhausted);
    EXPECT_THAT(refused.error().message, HasSubstr("no thread can be started for recording"));
    EXPECT_EQ(shortage.refused(), 1);
  }
  EXPECT_EQ(Logs(), 0u) << "no log that would be unfinished";
  EXPECT_FALSE(arm_->hub().WantsPictures(0)) << "no subscription";
  EXPECT_EQ(recorder_->Status().state(), v1::RECORDER_STATE_IDLE);

  ASSERT_TRUE(recorder_->Start(WithPictures(), "test").ok());
  EXPECT_TRUE(arm_->hub().WantsPictures(0));
  ASSERT_TRUE(recorder_->Stop("test").ok());
  EXPECT_EQ(Logs(), 1u);
}

TEST_F(RecordingStartTest, WithoutAThreadUnfinishedLogsStayAndTheServerGoesOn) {
  const std::string part = folder_.path() + "/test-20261122T120137Z-001.mcap.part";
  ASSERT_TRUE(recorder_->Start({}, "test").ok());
  ASSERT_TRUE(recorder_->Stop("test").ok());
  std::filesystem::rename(recorder_->folder().PathOf(recorder_->folder().List().front()), part);
  const ThreadShortage shortage("log-mender");
  recorder_->Open();
  EXPECT_EQ(shortage.refused(), 1);
  EXPECT_TRUE(std::filesystem::exists(part));
}

}  // namespace
}  // namespace taclink::server
