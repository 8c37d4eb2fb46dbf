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
  for (const auto& [there, piece] : {std::pair(0u, "first"), std::pair(5u, ", second")}) {
    auto target = DownloadTarget::Open(Path("log"));
    ASSERT_TRUE(target.ok()) << target.error().message;
    EXPECT_TRUE(target->can_resume());
    EXPECT_EQ(target->there(), there);
    ASSERT_TRUE(target->Write(piece).ok());
    EXPECT_EQ(target->size(), there + std::string(piece).size());
    ASSERT_TRUE(target->Close().ok());
  }
  EXPECT_EQ(Content("log"), "first, second");
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
  ASSERT_TRUE(target->Write("some").ok());
  ASSERT_TRUE(target->Write(" bytes").ok());
  target->RemoveIfNew();
  EXPECT_TRUE(fs::exists(pipe));
  std::array<char, 100> bytes{};
  const ssize_t got = ::read(reader, bytes.data(), bytes.size());
  EXPECT_EQ(std::string(bytes.data(), static_cast<size_t>(std::max<ssize_t>(got, 0))), "some bytes");
  ::close(reader);
  const auto written = target->Write("more");
  ASSERT_FALSE(written.ok()) << "nobody reads any more";
  EXPECT_THAT(written.error().message,
              AllOf(HasSubstr(pipe), HasSubstr("10 bytes"), HasSubstr("Broken pipe")));
}

TEST_F(DownloadTargetTest, ADeviceThatIsFullSaysSo) {
  auto target = DownloadTarget::Open("/dev/full");
  ASSERT_TRUE(target.ok()) << target.error().message;
  EXPECT_EQ(target->there(), 0u);
  const auto written = target->Write("some");
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
    EXPECT_TRUE(target->Write("a log").ok());
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
