// What the disk does to a recording: every call of the system fails with what disks fail with, and files,
// folders and disks go away. Whatever happens, it is told, and every frame is in the logs or counted as lost.
#include "tests/integration/recording_faults.h"

#include <gmock/gmock.h>
#include <sys/mount.h>

#include <array>
#include <cstring>

#include "tests/support/prerequisite.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

struct Fault {
  Call call;
  int number;
  bool loses;
};
void PrintTo(const Fault& fault, std::ostream* out) {
  *out << std::strerror(fault.number);
}

class FailingCallTest : public RecordingFaultsTest, public ::testing::WithParamInterface<Fault> {};

TEST_P(FailingCallTest, IsToldAndNoFrameIsUncounted) {
  const Fault& fault = GetParam();
  Start();
  calls_.Fail(fault.call, fault.number);
  Publish(4);
  const auto trouble =
      PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_TROUBLE; });
  EXPECT_THAT(trouble.trouble(), HasSubstr(std::strerror(fault.number)));
  EXPECT_THAT(trouble.trouble(), HasSubstr(folder_));
  // It lasts, and logs are tried again.
  for (int i = 0; i < 12; ++i) {
    Publish(1);
    PassARound(1.1);
  }
  EXPECT_GT(calls_.failed(), 1);
  calls_.Fail(Call::kNone, 0);
  PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_RECORDING; });
  Publish(6);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.state(), v1::RECORDER_STATE_IDLE);
  EXPECT_THAT(stopped.last_trouble(), HasSubstr(std::strerror(fault.number)));
  EXPECT_EQ(stopped.frames() + stopped.frames_lost(), published_);
  EXPECT_EQ(stopped.frames_lost() > 0, fault.loses);
  const auto frames = FramesIn(folder_);
  // What could not be synced may be there all the same.
  if (fault.call == Call::kSync)
    EXPECT_GE(frames.size(), stopped.frames());
  else
    EXPECT_EQ(frames.size(), stopped.frames());
  EXPECT_EQ(std::set<uint64_t>(frames.begin(), frames.end()).size(), frames.size());
  EXPECT_EQ(Told(std::strerror(fault.number)), 1) << "what comes back with every try is told once";
}

std::string FaultName(const ::testing::TestParamInfo<Fault>& info) {
  constexpr std::array kNames = {"None",     "Open",   "Write",  "Sync",  "SyncFolder",
                                 "Truncate", "Rename", "Status", "Access"};
  return std::string(kNames[static_cast<size_t>(info.param.call)]) + strerrorname_np(info.param.number);
}

INSTANTIATE_TEST_SUITE_P(Disk, FailingCallTest,
                         ::testing::Values(Fault{Call::kWrite, ENOSPC, true}, Fault{Call::kWrite, EIO, true},
                                           Fault{Call::kWrite, EROFS, true},
                                           Fault{Call::kWrite, EDQUOT, true},
                                           Fault{Call::kTruncate, EIO, true}, Fault{Call::kSync, EIO, true},
                                           Fault{Call::kSync, ENOSPC, true}, Fault{Call::kSync, EDQUOT, true},
                                           Fault{Call::kSync, EROFS, true},
                                           Fault{Call::kAccess, EROFS, false},
                                           Fault{Call::kAccess, EACCES, false}),
                         FaultName);

TEST_F(RecordingFaultsTest, ALogThatCannotGetItsNameIsWholeAllTheSame) {
  for (const Call call : {Call::kRename, Call::kSyncFolder}) {
    published_ = 0;
    Start();
    calls_.Fail(call, EIO);
    const auto stopped = Stop();
    calls_.Fail(Call::kNone, 0);
    EXPECT_THAT(stopped.last_trouble(), HasSubstr(std::strerror(EIO)));
    EXPECT_EQ(stopped.frames(), published_);
    EXPECT_EQ(stopped.frames_lost(), 0u);
    EXPECT_EQ(FramesIn(folder_).size(), published_);
    fs::remove_all(folder_);
  }
}

TEST_F(RecordingFaultsTest, AFileThatCannotBeLookedAtIsThere) {
  Start();
  calls_.Fail(Call::kStatus, EIO);
  Publish(5);
  Pass(1.1);
  WaitFor([this](const auto&) { return calls_.failed() > 0; });
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames_lost(), 0u);
  EXPECT_EQ(FramesIn(folder_).size(), published_);
}

TEST_F(RecordingFaultsTest, ADeletedLogIsLostAndTheNextBegins) {
  Start();
  for (const auto& file : fs::directory_iterator(folder_)) fs::remove(file.path());
  const auto next = PassUntil([](const auto& status) { return status.logs() == 2; });
  EXPECT_THAT(next.last_trouble(), HasSubstr("was deleted"));
  EXPECT_EQ(next.frames_lost(), 10u);
  EXPECT_EQ(Told("was deleted"), 1);
  Publish(5);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), 5u);
  EXPECT_EQ(stopped.frames_lost(), 10u);
  EXPECT_EQ(FramesIn(folder_).size(), 5u);
}

TEST_F(RecordingFaultsTest, AStopOnAFullDiskCountsWhatDidNotGetThere) {
  Start();
  calls_.Fail(Call::kWrite, ENOSPC);
  Publish(7);
  const auto stopped = Stop();
  calls_.Fail(Call::kNone, 0);
  EXPECT_EQ(stopped.frames(), 10u);
  EXPECT_EQ(stopped.frames_lost(), 7u);
  EXPECT_EQ(FramesIn(folder_).size(), 10u);
  EXPECT_EQ(stopped.trouble(), "") << "it is over";
  EXPECT_THAT(stopped.last_trouble(), HasSubstr(std::strerror(ENOSPC)));
}

TEST_F(RecordingFaultsTest, ALogThatAnotherProgramCutsIsLostAndTheNextBegins) {
  Start();
  for (const auto& file : fs::directory_iterator(folder_)) fs::resize_file(file.path(), 100);
  Publish(3);
  const auto next = PassUntil([](const auto& status) { return status.logs() == 2; });
  EXPECT_EQ(next.frames_lost(), 13u);
  Publish(5);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), 5u);
  EXPECT_EQ(stopped.frames_lost(), 13u);
  EXPECT_GE(Told("was cut"), 1);
}

TEST_F(RecordingFaultsTest, TwoRecordingsWithinASecondAreTwoLogs) {
  for (int i = 0; i < 3; ++i) {
    published_ = 0;
    ASSERT_TRUE(recordings_.Start(Uncompressed()).ok());
    Publish(4);
    WaitFor([](const auto& status) { return status.frames() == 4; });
    Stop();
  }
  EXPECT_EQ(FramesIn(folder_).size(), 12u);
}

TEST_F(RecordingFaultsTest, AFolderThatIsDeletedIsMadeAnew) {
  Start();
  fs::remove_all(folder_);
  const auto next = PassUntil([](const auto& status) { return status.logs() == 2; });
  constexpr auto kOthers = fs::perms::others_all;
  EXPECT_EQ(fs::status(folder_).permissions() & kOthers, fs::perms::none)
      << "forces and pictures are nobody else's";
  EXPECT_EQ(fs::status(folder_ + "/" + next.log() + ".part").permissions() & kOthers, fs::perms::none);
  Publish(5);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames_lost(), 10u);
  EXPECT_EQ(FramesIn(folder_).size(), 5u);
}

TEST_F(RecordingFaultsTest, WhatIsMovedAwayIsNotLost) {
  Start();
  const std::string away = folder_ + ".away";
  fs::rename(folder_, away);
  const auto next = PassUntil([](const auto& status) { return status.logs() == 2; });
  EXPECT_THAT(next.last_trouble(), HasSubstr("was moved"));
  EXPECT_EQ(next.frames_lost(), 0u);
  Publish(5);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), published_);
  EXPECT_EQ(FramesIn(folder_).size(), 5u);
  EXPECT_EQ(FramesIn(away).size(), 10u);
  fs::remove_all(away);
}

TEST_F(RecordingFaultsTest, AMovedLogGoesOnWhereNoOtherCanBegin) {
  Start();
  const std::string away = folder_ + ".away";
  fs::rename(folder_, away);
  calls_.Fail(Call::kOpen, EMFILE);
  const auto trouble =
      PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_TROUBLE; });
  EXPECT_THAT(trouble.trouble(), HasSubstr(std::strerror(EMFILE)));
  Publish(5);
  for (int i = 0; i < 5; ++i) PassARound();
  calls_.Fail(Call::kNone, 0);
  PassUntil([](const auto& status) { return status.logs() == 2; });
  Publish(3);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), published_);
  EXPECT_EQ(FramesIn(away).size(), 15u);
  EXPECT_EQ(FramesIn(folder_).size(), 3u);
  fs::remove_all(away);
}

class SplitFaultsTest : public RecordingFaultsTest {
 protected:
  SplitFaultsTest() : RecordingFaultsTest(5) {}
};

TEST_F(SplitFaultsTest, ALogThatCannotBeSplitGoesOnAndIsTroubleUntilItIs) {
  Start();
  calls_.Fail(Call::kOpen, EMFILE);
  PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_TROUBLE; });
  for (int i = 0; i < 12; ++i) {
    Publish(1);
    PassARound(1.1);
    EXPECT_EQ(recordings_.Status()->state(), v1::RECORDER_STATE_TROUBLE) << "also between two tries";
  }
  EXPECT_EQ(Told(std::strerror(EMFILE)), 1);
  calls_.Fail(Call::kNone, 0);
  PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_RECORDING; });
  const auto stopped = Stop();
  EXPECT_GE(stopped.logs(), 2u);
  EXPECT_EQ(stopped.frames_lost(), 0u);
  EXPECT_EQ(FramesIn(folder_).size(), published_);
}

// Something else is where the folder was: nothing can be recorded there.
TEST_F(RecordingFaultsTest, WhereNoLogCanBeginWhatIsLostIsCounted) {
  Start();
  fs::remove_all(folder_);
  fs::create_symlink("nowhere/at/all", folder_);
  const auto trouble =
      PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_TROUBLE; });
  EXPECT_THAT(trouble.trouble(), HasSubstr("the next one can't begin"));
  Publish(5);
  PassUntil([this](const auto& status) { return status.frames_lost() == published_; });
  for (int i = 0; i < 10; ++i) PassARound();
  EXPECT_EQ(Told("was deleted"), 2) << "that it was, and that no other can begin";
  fs::remove(folder_);
  PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_RECORDING; });
  Publish(5);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames(), 5u);
  EXPECT_EQ(stopped.frames_lost(), 15u);
}

/// A file system of this test's own, of one megabyte.
class SmallDiskTest : public RecordingFaultsTest {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    is_mounted_ = ::mount("none", folder_.c_str(), "tmpfs", 0, "size=1m") == 0;
    TACLINK_REQUIRE(is_mounted_, "may not mount a tmpfs (" << std::strerror(errno)
                                                           << "): run the tests as root with CAP_SYS_ADMIN");
  }
  ~SmallDiskTest() override { Unmount(); }
  void Unmount() {
    if (std::exchange(is_mounted_, false)) {
      EXPECT_EQ(::umount2(folder_.c_str(), MNT_DETACH), 0);
    }
  }
  bool is_mounted_ = false;
};

TEST_F(SmallDiskTest, IsFullIsEmptiedAndGoesOn) {
  Start();
  const auto full = WaitFor([this](const auto& status) {
    if (status.state() == v1::RECORDER_STATE_TROUBLE && status.frames_lost() > 0) return true;
    Publish(20);
    Pass(0.6);
    return false;
  });
  EXPECT_THAT(full.trouble(), HasSubstr("No space left"));
  ASSERT_EQ(::mount("none", folder_.c_str(), "tmpfs", MS_REMOUNT, "size=8m"), 0);
  PassUntil([](const auto& status) { return status.state() == v1::RECORDER_STATE_RECORDING; });
  Publish(7);
  const auto stopped = Stop();
  EXPECT_EQ(stopped.frames() + stopped.frames_lost(), published_);
  EXPECT_EQ(FramesIn(folder_).size(), stopped.frames());
}

TEST_F(SmallDiskTest, IsTakenAway) {
  Start();
  Unmount();
  const auto next = PassUntil([](const auto& status) { return status.logs() == 2; });
  EXPECT_THAT(next.last_trouble(), HasSubstr("its disk was taken away"));
  EXPECT_EQ(next.frames_lost(), 0u);
  Publish(5);
  EXPECT_EQ(Stop().frames(), published_);
  EXPECT_EQ(FramesIn(folder_).size(), 5u) << "the others went with the disk";
}

}  // namespace
}  // namespace taclink::server
