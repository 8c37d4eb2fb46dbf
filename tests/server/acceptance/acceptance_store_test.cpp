#include "server/acceptance/acceptance_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>

#include "sensing/model/model_file.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using testing::HasSubstr;

constexpr const char* kPlan =
    "taclink_acceptance: 1\nname: small\nseries: [{name: a, force_n: 0.5, places: 4}]\n";

class AcceptanceStoreTest : public testing::Test {
 protected:
  AcceptanceStoreTest() { std::filesystem::create_directories(folder_); }
  ~AcceptanceStoreTest() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<AcceptanceStore> Open(const std::string& folder) {
    return std::make_unique<AcceptanceStore>(
        std::vector<AcceptedLink>{{.name = "upper",
                                   .model = *LoadLinkModel("cylinder"),
                                   .model_hash = model_hash_,
                                   .calibrated_utc_ns = [this] { return calibrated_utc_ns_; }}},
        folder, clock_);
  }
  std::unique_ptr<AcceptanceStore> Open() { return Open(folder_); }

  static TrialReading Felt(double force_n) {
    TrialReading reading;
    reading.frames = reading.usable = 30;
    reading.has_contact = true;
    reading.force_n = force_n;
    return reading;
  }

  static void MeasureAll(AcceptanceStore& store, double force_n) {
    for (uint32_t id = 1; id <= 4; ++id) {
      TrialReading reading = Felt(force_n + 0.001 * id);
      const auto trial = store.Trial(0, id);
      ASSERT_TRUE(trial.ok());
      reading.center_mm = *trial->reference.place_mm;
      reading.total_force_n = reading.force_n * *trial->reference.direction;
      ASSERT_TRUE(store.Store(0, id, v1::TRIAL_PHASE_LOADED, reading, trial->reference).ok());
    }
  }

  const std::string folder_ = testing::TempDir() + "acceptance." + std::to_string(::getpid());
  ManualClock clock_;
  std::string model_hash_ = "m1";
  int64_t calibrated_utc_ns_ = 5;
};

TEST_F(AcceptanceStoreTest, ReadingsOfAKilledServerAreThereAndResumed) {
  {
    const auto store = Open();
    const auto started = store->Start(0, "", kPlan, false);
    ASSERT_TRUE(started.ok()) << started.error().message;
    EXPECT_EQ(started->trials_size(), 4);
    EXPECT_EQ(started->next_trial(), 1u);
    ASSERT_TRUE(store->Store(0, 1, v1::TRIAL_PHASE_LOADED, Felt(0.52), TrialReference{.force_n = 0.51}).ok());
  }
  const auto store = Open();
  const auto other = store->Start(0, "quick", "", false);
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(other.error().message, HasSubstr("small"));
  const auto resumed = store->Start(0, "", kPlan, false);
  ASSERT_TRUE(resumed.ok());
  EXPECT_EQ(resumed->next_trial(), 2u);
  EXPECT_EQ(resumed->trials(0).loaded().force_n(), 0.52);
  EXPECT_EQ(resumed->trials(0).reference().force_n(), 0.51);
  EXPECT_EQ(resumed->report().measured(), 1u);
}

TEST_F(AcceptanceStoreTest, FinishedOneStaysWithTheLinkUntilModelOrCalibrationChange) {
  auto store = Open();
  EXPECT_FALSE(store->Summary(0));
  ASSERT_TRUE(store->Start(0, "", kPlan, false).ok());
  const auto early = store->Finish(0, false);
  ASSERT_FALSE(early.ok());
  EXPECT_THAT(early.error().message, HasSubstr("nothing was measured"));
  MeasureAll(*store, 0.5);
  const auto finished = store->Finish(0, false);
  ASSERT_TRUE(finished.ok()) << finished.error().message;
  EXPECT_EQ(finished->report().verdict(), v1::ACCEPTANCE_VERDICT_PASSED);
  EXPECT_EQ(finished->finished_utc_ns(), clock_.UtcNs());
  store = Open();
  auto summary = store->Summary(0);
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->verdict(), v1::ACCEPTANCE_VERDICT_PASSED);
  EXPECT_NEAR(summary->force_bias(), 0.005, 1e-9);
  EXPECT_EQ(summary->outdated(), "");
  calibrated_utc_ns_ = 0;  // as long as the link takes its rest shape
  EXPECT_EQ(store->Summary(0)->outdated(), "");
  calibrated_utc_ns_ = 6;
  EXPECT_THAT(store->Summary(0)->outdated(), HasSubstr("calibrated"));
  model_hash_ = "m2";
  EXPECT_THAT(Open()->Summary(0)->outdated(), HasSubstr("model"));
  const auto files = store->Get(0, true, true);
  ASSERT_TRUE(files.ok());
  EXPECT_THAT(files->report_html(), HasSubstr("<svg"));
  EXPECT_THAT(files->report_csv(), HasSubstr("trial,kind"));
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/upper/report.html"));
}

TEST_F(AcceptanceStoreTest, NothingReplacesAnAcceptanceWhoseTrialIsBeingMeasured) {
  const auto store = Open();
  ASSERT_TRUE(store->Start(0, "", kPlan, false).ok());
  ASSERT_TRUE(store->Claim(0));
  EXPECT_THAT(store->Start(0, "quick", "", true).error().message, HasSubstr("is being measured"));
  EXPECT_THAT(store->Finish(0, true).error().message, HasSubstr("is being measured"));
  store->Release(0);
  EXPECT_TRUE(store->Start(0, "quick", "", true).ok());
}

TEST_F(AcceptanceStoreTest, WhatCannotBeReadIsNotOverwritten) {
  ASSERT_TRUE(Open()->Start(0, "", kPlan, false).ok());
  const std::string path = folder_ + "/upper/current.json";
  std::ofstream(path, std::ios::trunc) << "{ torn";
  const auto store = Open();
  EXPECT_THAT(store->Start(0, "", kPlan, false).error().message, HasSubstr("cannot be read"));
  EXPECT_FALSE(std::filesystem::exists(path + ".unreadable"));
  EXPECT_TRUE(store->Start(0, "", kPlan, true).ok());
  EXPECT_TRUE(std::filesystem::exists(path + ".unreadable"));
}

TEST_F(AcceptanceStoreTest, AnotherModelIsNotResumed) {
  ASSERT_TRUE(Open()->Start(0, "", kPlan, false).ok());
  model_hash_ = "m2";
  EXPECT_THAT(Open()->Start(0, "", kPlan, false).error().message, HasSubstr("was changed since"));
}

TEST_F(AcceptanceStoreTest, LogsCarryTheFinishedOne) {
  const auto store = Open();
  EXPECT_EQ(store->FinishedFile(0), "");
  ASSERT_TRUE(store->Start(0, "", kPlan, false).ok());
  MeasureAll(*store, 0.5);
  ASSERT_TRUE(store->Finish(0, false).ok());
  const AcceptanceStore replayed({{.name = "upper",
                                   .model = *LoadLinkModel("cylinder"),
                                   .model_hash = "",
                                   .recorded = store->FinishedFile(0)}},
                                 "", clock_);
  ASSERT_TRUE(replayed.Summary(0));
  EXPECT_EQ(replayed.Summary(0)->outdated(), "");
  EXPECT_TRUE(replayed.Get(0, false, false).ok());
}

TEST_F(AcceptanceStoreTest, SecondServerDoesNotWriteIntoTheFirstOnes) {
  const auto first = Open(), second = Open();
  ASSERT_TRUE(first->Start(0, "", kPlan, false).ok());
  const auto refused = second->Start(0, "", kPlan, true);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(refused.error().message, HasSubstr("acceptance.folder"));
  ASSERT_TRUE(first->Store(0, 1, v1::TRIAL_PHASE_LOADED, Felt(0.5), {}).ok());
  EXPECT_EQ(first->Get(0, false, false)->report().measured(), 1u);
}

TEST_F(AcceptanceStoreTest, SkippedTrialsCanBeOpenedAgain) {
  const auto store = Open();
  ASSERT_TRUE(store->Start(0, "", kPlan, false).ok());
  EXPECT_EQ(store->Skip(0, 1, false)->next_trial(), 2u);
  EXPECT_EQ(store->Skip(0, 1, true)->next_trial(), 1u);
  const auto missing = store->Skip(0, 9, false);
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
}

TEST_F(AcceptanceStoreTest, DiscardingKeepsTheLastFinishedOne) {
  const auto store = Open();
  EXPECT_FALSE(store->Finish(0, true).ok());
  ASSERT_TRUE(store->Start(0, "", kPlan, false).ok());
  MeasureAll(*store, 0.5);
  ASSERT_TRUE(store->Finish(0, false).ok());
  ASSERT_TRUE(store->Start(0, "quick", "", false).ok());
  ASSERT_TRUE(store->Finish(0, true).ok());
  EXPECT_EQ(store->Get(0, false, false)->plan(), "small");
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/upper/current.json"));
}

TEST_F(AcceptanceStoreTest, DamagedFilesAreLeftAloneAndDoNotStopTheServer) {
  std::filesystem::create_directories(folder_ + "/upper");
  std::ofstream(folder_ + "/upper/accepted.json") << "{\"link\": \"upp";
  std::ofstream(folder_ + "/upper/current.json") << std::string("\xff\xfe\0", 3);
  const auto store = Open();
  EXPECT_FALSE(store->Summary(0));
  EXPECT_FALSE(store->Get(0, false, false).ok());
  EXPECT_EQ(std::filesystem::file_size(folder_ + "/upper/accepted.json"), 13u);
}

TEST_F(AcceptanceStoreTest, WhatCannotBeWrittenIsRefused) {
  const std::string file = folder_ + "/file";
  std::ofstream(file) << "x";
  const auto started = Open(file)->Start(0, "", kPlan, false);
  ASSERT_FALSE(started.ok());
  EXPECT_EQ(started.error().code, ErrorCode::kUnavailable);
  const auto none = Open("")->Start(0, "quick", "", false);
  ASSERT_FALSE(none.ok());
  EXPECT_THAT(none.error().message, HasSubstr("acceptance: {folder"));
  const auto unknown = Open()->Start(0, "no-plan", "", false);
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalidArgument);
}

// A plan by its name on the server must not read the server's files.
TEST_F(AcceptanceStoreTest, PlanNamesAreNotPaths) {
  const std::string file = folder_ + "/plan.yaml";
  std::ofstream(file) << kPlan;
  EXPECT_FALSE(Open()->Start(0, file, "", false).ok());
}

}  // namespace
}  // namespace taclink::server
