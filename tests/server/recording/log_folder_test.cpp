#include "server/recording/log_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <set>
#include <span>

#include "mcap/reader.h"
#include "server/recording/file_lock.h"
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

TEST_F(LogFolderTest, LogsThatAreBeingWrittenAreNotDeleted) {
  Write("a.mcap.part", 1);
  Write("left.mcap.part", 1);
  EXPECT_TRUE(folder_.Delete("left.mcap").ok()) << "nobody writes it";
  const auto writer = FileLock::TryTake(folder_.PartPath("a.mcap"), folder_.calls());
  ASSERT_TRUE(writer.ok());
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

// What a server that is killed has written, with these messages and chunks.
class UnfinishedLog {
 public:
  explicit UnfinishedLog(const LogFolder& folder) : folder_(folder) {
    mcap::WriterOptions options;
    options.chunk_bytes = 1000;
    auto file = LogFile::Create(folder_, "a.mcap", {}, options, 5);
    EXPECT_TRUE(file.ok()) << file.error().message;
    const auto channel = (*file)->writer().mcap().AddChannel({.topic = "t", .message_encoding = "json"});
    EXPECT_TRUE(channel.ok());
    const std::string data(300, 'm');
    for (uint32_t i = 1; i <= 40; ++i)
      EXPECT_TRUE((*file)
                      ->writer()
                      .mcap()
                      .Write({.channel_id = *channel,
                              .sequence = i,
                              .log_time_ns = i,
                              .publish_time_ns = i,
                              .data = std::as_bytes(std::span(data))})
                      .ok());
    EXPECT_TRUE((*file)->Sync().ok());
  }
  size_t bytes() const { return fs::file_size(folder_.PartPath("a.mcap")); }
  void Damage(size_t at) const {
    std::fstream file(folder_.PartPath("a.mcap"), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(at));
    file << "damaged";
  }
  void CutTo(size_t bytes) const { fs::resize_file(folder_.PartPath("a.mcap"), bytes); }

 private:
  const LogFolder& folder_;
};

TEST_F(LogFolderTest, OfATornEndNothingIsKept) {
  const UnfinishedLog log(folder_);
  log.CutTo(log.bytes() - 200);
  EXPECT_THAT(folder_.Recover("a.mcap").value_or(""), HasSubstr("made whole"));
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap"));
}

TEST_F(LogFolderTest, ALogThatIsDamagedElsewhereIsKept) {
  const UnfinishedLog log(folder_);
  log.Damage(log.bytes() / 2);
  const size_t bytes = log.bytes();
  EXPECT_THAT(folder_.Recover("a.mcap").value_or(""), HasSubstr("kept as a.damaged.mcap"));
  EXPECT_THAT(Names(), ::testing::ElementsAre("a.mcap", "a.damaged.mcap"));
  EXPECT_EQ(fs::file_size(folder_.FinalPath("a.damaged.mcap")), bytes);
}

TEST_F(LogFolderTest, ALogOfWhichLittleIsSavedIsKept) {
  const UnfinishedLog log(folder_);
  log.CutTo(1000);  // the first chunk is torn
  EXPECT_THAT(folder_.Recover("a.mcap").value_or(""), HasSubstr("kept as a.damaged.mcap"));
  EXPECT_EQ(fs::file_size(folder_.FinalPath("a.damaged.mcap")), 1000u);
}

TEST_F(LogFolderTest, AnUnfinishedLogWhoseNameIsTakenGetsAnother) {
  const UnfinishedLog log(folder_);
  Write("a.mcap", 7);
  ASSERT_EQ(folder_.Unfinished().size(), 1u);
  EXPECT_THAT(folder_.Recover("a.mcap").value_or(""), HasSubstr("as a.recovered.mcap"));
  EXPECT_THAT(Names(), ::testing::UnorderedElementsAre("a.mcap", "a.recovered.mcap"));
  EXPECT_EQ(fs::file_size(folder_.FinalPath("a.mcap")), 7u);
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
