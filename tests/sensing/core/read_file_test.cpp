#include "sensing/core/read_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>

namespace taclink {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ReadFileTest : public ::testing::Test {
 protected:
  ReadFileTest() : folder_(::testing::TempDir() + "read-file." + std::to_string(::getpid())) {
    fs::create_directories(folder_);
  }
  ~ReadFileTest() override { fs::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
    return folder_ / name;
  }
  static void ExpectRefused(const std::string& path, ErrorCode code, const std::string& what) {
    const auto content = ReadFile(path);
    ASSERT_FALSE(content.ok());
    EXPECT_EQ(content.error().code, code);
    EXPECT_THAT(content.error().message, AllOf(HasSubstr(path), HasSubstr(what)));
  }
  const fs::path folder_;
};

TEST_F(ReadFileTest, GivesAllOfIt) {
  const std::string content = std::string("a\0b\r\n", 5) + std::string(200'000, 'x');
  EXPECT_EQ(ReadFile(Write("a", content)).value(), content);
  EXPECT_EQ(ReadFile(Write("empty", "")).value(), "");
  EXPECT_EQ(ReadBeginning(folder_ / "a", 3).value(), content.substr(0, 3));
  fs::create_symlink("a", folder_ / "link");
  EXPECT_EQ(ReadFile(folder_ / "link").value(), content) << "as secrets are mounted into containers";
}

TEST_F(ReadFileTest, AByteOrderMarkIsNoPartOfAText) {
  EXPECT_EQ(ReadText(Write("marked",
                           "\xEF\xBB\xBF"
                           "eve"))
                .value(),
            "eve");
  EXPECT_EQ(ReadText(Write("plain", "eve \xEF\xBB\xBF")).value(), "eve \xEF\xBB\xBF")
      << "only where a text begins";
  EXPECT_EQ(ReadText(Write("mark", "\xEF\xBB\xBF")).value(), "");
  EXPECT_EQ(ReadFile(folder_ / "mark").value().size(), 3u);
}

TEST_F(ReadFileTest, WhatTheMachineCannotReadNowSaysNothingOfTheFile) {
  for (const int number : {EMFILE, ENFILE, ENOMEM, EIO, EINTR, EAGAIN, ESTALE})
    EXPECT_EQ(FileError("/a", number).code, ErrorCode::kUnavailable) << number;
  for (const int number : {ENOENT, ENOTDIR, ELOOP, ENAMETOOLONG})
    EXPECT_EQ(FileError("/a", number).code, ErrorCode::kNotFound) << number;
  EXPECT_EQ(FileError("/a", EACCES).code, ErrorCode::kPermissionDenied);
  EXPECT_THAT(FileError("/a", EMFILE).message, AllOf(HasSubstr("/a"), HasSubstr("LimitNOFILE")));
}

// Each would keep a program waiting, or fill its memory.
TEST_F(ReadFileTest, OnlyRegularFiles) {
  ExpectRefused(folder_, ErrorCode::kInvalidArgument, "is a folder");
  const std::string pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  ExpectRefused(pipe, ErrorCode::kInvalidArgument, "is a pipe");
  ExpectRefused("/dev/zero", ErrorCode::kInvalidArgument, "is a device");
  const std::string socket = folder_ / "socket";
  ASSERT_EQ(::mknod(socket.c_str(), S_IFSOCK | 0600, 0), 0);
  ExpectRefused(socket, ErrorCode::kInvalidArgument, "is a socket");
  ExpectRefused(folder_ / "none", ErrorCode::kNotFound, "check the path");
  ExpectRefused(Write("file", "x") + "/below", ErrorCode::kNotFound, "check the path");
}

TEST_F(ReadFileTest, NoneThatIsTooLarge) {
  const std::string path = Write("large", std::string(11, 'x'));
  EXPECT_TRUE(ReadFile(path, 11).ok());
  EXPECT_EQ(ReadFile(path, 10).error().code, ErrorCode::kInvalidArgument);
  // Nothing is made room for.
  const std::string sparse = Write("sparse", "");
  fs::resize_file(sparse, uint64_t{1} << 40);
  ExpectRefused(sparse, ErrorCode::kInvalidArgument, "is larger than 16 MiB");
}

/// As somebody who may not read everything, where this program's user may.
class AsNobody {
 public:
  AsNobody() : before_(::geteuid()) {
    if (before_ == 0) {
      EXPECT_EQ(::seteuid(kNobody), 0);
    }
  }
  ~AsNobody() { EXPECT_EQ(::seteuid(before_), 0); }
  AsNobody(const AsNobody&) = delete;
  AsNobody& operator=(const AsNobody&) = delete;

 private:
  static constexpr uid_t kNobody = 65534;
  const uid_t before_;
};

TEST_F(ReadFileTest, WhatMayNotBeRead) {
  const std::string path = Write("secret", "x");
  fs::permissions(path, fs::perms::none);
  const AsNobody nobody;
  ExpectRefused(path, ErrorCode::kPermissionDenied, "see who may read it");
}

}  // namespace
}  // namespace taclink
