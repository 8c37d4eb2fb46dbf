#include "client/command/live/download_target.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace taclink::command {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class DownloadTargetTest : public ::testing::Test {
 protected:
  DownloadTargetTest() : folder_(::testing::TempDir() + "download-target." + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~DownloadTargetTest() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return folder_ / name; }
  std::string Content(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(Path(name), std::ios::binary).rdbuf();
    return text.str();
  }
  static std::string Refusal(const std::string& path) {
    const auto target = DownloadTarget::Open(path);
    return target ? "none" : target.error().message;
  }
  const fs::path folder_;
};

TEST_F(DownloadTargetTest, AFileIsMadeAndGoesOnWhereItEnds) {
  const std::string log = "first, second";
  for (const auto& [there, end] : {std::pair(0u, 5u), std::pair(5u, 13u)}) {
    auto target = DownloadTarget::Open(Path("log"));
    ASSERT_TRUE(target.ok()) << target.error().message;
    EXPECT_TRUE(target->can_resume());
    EXPECT_EQ(target->there(), there);
    EXPECT_EQ(target->start(), 0u);
    ASSERT_TRUE(target->Receive(log.substr(0, end), 0).ok());
    EXPECT_EQ(target->size(), end);
    ASSERT_TRUE(target->Close().ok());
  }
  EXPECT_EQ(Content("log"), log);
}

TEST_F(DownloadTargetTest, OfALongFileOnlyTheEndIsFetchedAgain) {
  const std::string log(200'000, 'x');
  std::ofstream(Path("log")) << log.substr(0, 150'000);
  auto target = DownloadTarget::Open(Path("log"));
  ASSERT_TRUE(target.ok()) << target.error().message;
  EXPECT_EQ(target->start(), 150'000u - 65'536u);
  for (uint64_t at = target->start(); at < log.size(); at += 50'000)
    ASSERT_TRUE(target->Receive(std::string_view(log).substr(at, 50'000), at).ok());
  ASSERT_TRUE(target->Close().ok());
  EXPECT_EQ(Content("log"), log);
}

TEST_F(DownloadTargetTest, OnlyTheSameLogGoesOn) {
  for (const std::string there : {"another log", "firsT", "first log, and more"}) {
    std::ofstream(Path("log")) << there;
    auto target = DownloadTarget::Open(Path("log"));
    ASSERT_TRUE(target.ok()) << target.error().message;
    auto done = target->Receive("first log", 0);
    if (done) done = target->Close();
    ASSERT_FALSE(done.ok()) << there;
    EXPECT_EQ(done.error().code, ErrorCode::kFailedPrecondition);
    EXPECT_THAT(done.error().message, AllOf(HasSubstr(Path("log")), HasSubstr("something else")));
    target->RemoveIfNew();
    EXPECT_EQ(Content("log"), there) << "it is not changed";
  }
}

TEST_F(DownloadTargetTest, APieceThatDoesNotFollowIsRefused) {
  auto target = DownloadTarget::Open(Path("log"));
  ASSERT_TRUE(target.ok()) << target.error().message;
  ASSERT_TRUE(target->Receive("some", 0).ok());
  EXPECT_EQ(target->Receive("bytes", 5).error().code, ErrorCode::kInternal);
  EXPECT_EQ(Content("log"), "some");
}

TEST_F(DownloadTargetTest, OnlyAFileThatIsNewAndEmptyIsRemoved) {
  std::ofstream(Path("empty")) << "";
  for (const std::string name : {"new", "empty"}) {
    auto target = DownloadTarget::Open(Path(name));
    ASSERT_TRUE(target.ok()) << target.error().message;
    target->RemoveIfNew();
    EXPECT_EQ(fs::exists(Path(name)), name == "empty");
  }
}

TEST_F(DownloadTargetTest, APipeTakesAllInSequence) {
  const std::string pipe = Path("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  auto target = DownloadTarget::Open(pipe);
  ASSERT_TRUE(target.ok()) << target.error().message;
  EXPECT_FALSE(target->can_resume());
  EXPECT_EQ(target->there(), 0u);
  ASSERT_TRUE(target->Receive("some", 0).ok());
  ASSERT_TRUE(target->Receive(" bytes", 4).ok());
  target->RemoveIfNew();
  EXPECT_TRUE(fs::exists(pipe));
  std::array<char, 100> bytes{};
  const ssize_t got = ::read(reader, bytes.data(), bytes.size());
  EXPECT_EQ(std::string(bytes.data(), static_cast<size_t>(std::max<ssize_t>(got, 0))), "some bytes");
  ::close(reader);
  const auto written = target->Receive("more", 10);
  ASSERT_FALSE(written.ok()) << "nobody reads any more";
  EXPECT_THAT(written.error().message,
              AllOf(HasSubstr(pipe), HasSubstr("10 bytes"), HasSubstr("Broken pipe")));
}

TEST_F(DownloadTargetTest, ADeviceThatIsFullSaysSo) {
  auto target = DownloadTarget::Open("/dev/full");
  ASSERT_TRUE(target.ok()) << target.error().message;
  EXPECT_EQ(target->there(), 0u);
  const auto written = target->Receive("some", 0);
  ASSERT_FALSE(written.ok());
  EXPECT_EQ(written.error().code, ErrorCode::kResourceExhausted);
  EXPECT_THAT(written.error().message, AllOf(HasSubstr("/dev/full"), HasSubstr("No space left on device")));
}

TEST_F(DownloadTargetTest, WhatCannotTakeALogIsNamed) {
  EXPECT_THAT(Refusal(folder_), HasSubstr("a folder"));
  const std::string socket = Path("socket");
  ASSERT_EQ(::mknod(socket.c_str(), S_IFSOCK | 0600, 0), 0);
  EXPECT_THAT(Refusal(socket), HasSubstr("a socket"));
  EXPECT_THAT(Refusal(Path("none/log")),
              AllOf(HasSubstr("none/log"), HasSubstr("No such file or directory")));
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_GE(terminal, 0);
  ASSERT_EQ(::grantpt(terminal), 0);
  ASSERT_EQ(::unlockpt(terminal), 0);
  std::array<char, 100> name{};
  ASSERT_EQ(::ptsname_r(terminal, name.data(), name.size()), 0);
  EXPECT_THAT(Refusal(name.data()), HasSubstr("a terminal"));
  ::close(terminal);
}

TEST_F(DownloadTargetTest, StandardOutputIsNoFileOfThatName) {
  const int before = ::dup(STDOUT_FILENO);
  ASSERT_GE(before, 0);
  std::fflush(stdout);
  const int file = ::open(Path("out").c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  ASSERT_EQ(::dup2(file, STDOUT_FILENO), STDOUT_FILENO);
  {
    auto target = DownloadTarget::Open("-");
    ASSERT_TRUE(target.ok()) << target.error().message;
    EXPECT_TRUE(target->is_stdout());
    EXPECT_FALSE(target->can_resume());
    EXPECT_TRUE(target->Receive("a log", 0).ok());
    EXPECT_TRUE(target->Close().ok());
  }
  ASSERT_EQ(::dup2(before, STDOUT_FILENO), STDOUT_FILENO) << "it is not closed";
  ::close(before);
  ::close(file);
  EXPECT_EQ(Content("out"), "a log");
  EXPECT_FALSE(fs::exists("-"));
}

}  // namespace
}  // namespace taclink::command
