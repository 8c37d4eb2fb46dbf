#include "server/recording/log_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <set>

#include "mcap/reader.h"
#include "server/recording/log_file.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class LogFolderTest : public ::testing::Test {
 protected:
  LogFolderTest() {
    fs::remove_all(folder_.path());
    EXPECT_TRUE(folder_.Prepare().ok());
  }
  ~LogFolderTest() override { fs::remove_all(folder_.path()); }
  void Write(const std::string& file, size_t bytes) const {
    std::ofstream(folder_.path() + "/" + file) << std::string(bytes, 'x');
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& log : folder_.List()) names.push_back(log.name + (log.open ? " open" : ""));
    return names;
  }

  const LogFolder folder_{::testing::TempDir() + "log_folder." + std::to_string(::getpid())};
};

TEST_F(LogFolderTest, ListsItsLogsAndNothingElse) {
  Write("arm-2.mcap", 2);
  Write("arm-1.mcap", 1);
  Write("arm-3.mcap.part", 3);
  Write("notes.txt", 4);
  Write("arm-4.mcap.recovering", 4);
  EXPECT_THAT(Names(), ::testing::ElementsAre("arm-1.mcap", "arm-2.mcap", "arm-3.mcap open"));
  EXPECT_EQ(folder_.Find("arm-2.mcap")->bytes, 2u);
  EXPECT_EQ(folder_.Find("arm-9.mcap").error().code, ErrorCode::kNotFound);
  for (const char* evil : {"../arm-1.mcap", "/etc/passwd", "", ".mcap", ".hidden.mcap", "a b.mcap"})
    EXPECT_EQ(folder_.Find(evil).error().code, ErrorCode::kInvalidArgument) << evil;
}

TEST_F(LogFolderTest, OpenLogsAreNotDeleted) {
  Write("a.mcap.part", 1);
  EXPECT_EQ(folder_.Delete("a.mcap").error().code, ErrorCode::kFailedPrecondition);
  Write("b.mcap", 1);
  EXPECT_TRUE(folder_.Delete("b.mcap").ok());
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap open"));
}

TEST_F(LogFolderTest, TheOldestGiveWayToTheQuota) {
  for (const char* name : {"a.mcap.part", "b.mcap", "c.mcap", "d.mcap"}) Write(name, 1000);
  EXPECT_THAT(folder_.EnforceQuota(4000), ::testing::IsEmpty());
  EXPECT_THAT(folder_.EnforceQuota(2500), ::testing::ElementsAre("b.mcap", "c.mcap"));
  EXPECT_THAT(folder_.EnforceQuota(0), ::testing::ElementsAre("d.mcap"));
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap open"));
}

TEST_F(LogFolderTest, OrderIsThatOfRecordingAndNotOfNames) {
  Write("copied.mcap", 1000);
  for (const char* name : {"zeta.mcap", "middle.mcap", "alpha.mcap"}) {
    ASSERT_TRUE(folder_.Begin(name).ok());
    Write(name, 1000);
  }
  EXPECT_THAT(Names(), ::testing::ElementsAre("copied.mcap", "zeta.mcap", "middle.mcap", "alpha.mcap"));
  // Another run, with another object; and a line that a power cut has torn.
  std::ofstream(folder_.path() + "/" + LogOrder::kFile, std::ios::app) << "copied.mc";
  const LogFolder later(folder_.path());
  ASSERT_TRUE(later.Begin("beta.mcap").ok());
  Write("beta.mcap", 1000);
  EXPECT_THAT(Names(),
              ::testing::ElementsAre("copied.mcap", "zeta.mcap", "middle.mcap", "alpha.mcap", "beta.mcap"));
  EXPECT_THAT(later.EnforceQuota(2500), ::testing::ElementsAre("copied.mcap", "zeta.mcap", "middle.mcap"));
}

TEST_F(LogFolderTest, TheOrderDoesNotGrowWithDeletedLogs) {
  const LogOrder order(folder_.path(), folder_.calls());
  std::ofstream old(folder_.path() + "/" + LogOrder::kFile);
  for (int i = 0; i < 5000; ++i) old << "gone-" << i << ".mcap\n";
  old.close();
  for (const char* name : {"b.mcap", "a.mcap"}) ASSERT_TRUE(order.Append(name).ok());
  order.Compact([] { return std::set<std::string>{"a.mcap", "b.mcap"}; });
  const auto ranks = order.Ranks();
  ASSERT_EQ(ranks.size(), 2u);
  EXPECT_LT(ranks.at("b.mcap"), ranks.at("a.mcap"));
}

TEST_F(LogFolderTest, ALogThatIsBeingWrittenIsLeftToItsWriter) {
  auto file =
      LogFile::Create(folder_, "a.mcap", {.files = {{"x", "text/plain", "hello"}}, .metadata = {}}, {}, 5);
  ASSERT_TRUE(file.ok()) << file.error().message;
  ASSERT_TRUE((*file)->Sync().ok());
  EXPECT_EQ(folder_.Recover("a.mcap"), std::nullopt);
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap open"));
  ASSERT_TRUE((*file)->Close({}, {}).ok());
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap"));
  EXPECT_EQ(folder_.Recover("a.mcap"), std::nullopt) << "its writer has closed it meanwhile";
}

TEST_F(LogFolderTest, ALogDoesNotTakeTheNameOfAnother) {
  auto file = LogFile::Create(folder_, "a.mcap", {}, {}, 5);
  ASSERT_TRUE(file.ok()) << file.error().message;
  Write("a.mcap", 7);
  EXPECT_FALSE((*file)->Close({}, {}).ok());
  EXPECT_TRUE((*file)->is_complete());
  EXPECT_EQ(fs::file_size(folder_.FinalPath("a.mcap")), 7u);
  EXPECT_TRUE(fs::exists(folder_.PartPath("a.mcap")));
}

class NoLocks final : public mcap::FileCalls {
 public:
  int Lock(int) override {
    errno = EOPNOTSUPP;
    return -1;
  }
};

TEST_F(LogFolderTest, WithoutLocksAnOpenLogIsWrittenAndLeftAlone) {
  NoLocks calls;
  const LogFolder folder(folder_.path(), calls);
  auto file = LogFile::Create(folder, "a.mcap", {}, {}, 5);
  ASSERT_TRUE(file.ok()) << file.error().message;
  EXPECT_THAT(folder.Recover("a.mcap").value_or(""), HasSubstr("taclink log recover"));
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap open"));
  EXPECT_TRUE((*file)->Close({}, {}).ok());
}

TEST_F(LogFolderTest, AnUnfinishedLogIsMadeWhole) {
  {
    auto file =
        LogFile::Create(folder_, "a.mcap", {.files = {{"x", "text/plain", "hello"}}, .metadata = {}}, {}, 5);
    ASSERT_TRUE(file.ok()) << file.error().message;
    ASSERT_TRUE((*file)->Sync().ok());
  }
  Write("b.mcap.part", 100);
  ASSERT_EQ(folder_.Unfinished().size(), 2u);
  EXPECT_THAT(folder_.Recover("a.mcap").value_or(""), HasSubstr("made whole"));
  EXPECT_THAT(folder_.Recover("b.mcap").value_or(""), HasSubstr("b.mcap.part"));  // no log: stays
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap", "b.mcap open"));
  auto source = mcap::FileSource::Open(folder_.FinalPath("a.mcap"));
  ASSERT_TRUE(source.ok());
  const auto reader = mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(*source)));
  ASSERT_TRUE(reader.ok());
  EXPECT_EQ((*reader)->summary_problem(), "");
  EXPECT_EQ((*reader)->attachments().size(), 1u);
}

TEST(LogFolder, AFolderThatCannotBeIsRefused) {
  EXPECT_FALSE(LogFolder("/proc/nowhere/logs").Prepare().ok());
}

TEST(LogName, IsMadeOfArmTimeAndPart) {
  EXPECT_EQ(LogName("arm", 1'700'000'000'999'999'999, 2), "arm-20231114T221320Z-002.mcap");
  EXPECT_TRUE(IsLogName(LogName("a_b-1", 0, 1)));
}

}  // namespace
}  // namespace taclink::server
