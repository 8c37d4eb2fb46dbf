#include "server/process/log_writer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <thread>
#include <vector>

#include "server/process/log.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr minutes kLong{5};

std::vector<std::string> SplitLines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string CountLineOf(const LeftOutLines& lines) {
  return fmt::format("{} left out in {} s, error {}\n", lines.count, lines.during.count(), lines.error);
}

/// What a LogWriter writes to: can be blocked, and can fail.
class Output {
 public:
  LogWriter::Write Writing() {
    return [this](std::string_view bytes) { return Write(bytes); };
  }
  void Block() {
    Set([this] { is_blocked_ = true; });
  }
  void Release() {
    Set([this] { is_blocked_ = false; });
  }
  void Fail(int error) {
    Set([this, error] { error_ = error; });
  }
  void TakeAtMost(size_t bytes) {
    Set([this, bytes] { most_ = bytes; });
  }
  /// Until a write has been waiting for Release.
  void AwaitBlocked() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_waiting_; });
  }
  void AwaitFailures(int failures) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failures_ >= failures; });
  }
  std::vector<std::string> Lines() {
    const std::lock_guard lock(mutex_);
    return SplitLines(text_);
  }

 private:
  void Set(const std::function<void()>& change) {
    const std::lock_guard lock(mutex_);
    change();
    changed_.notify_all();
  }
  ssize_t Write(std::string_view bytes) {
    std::unique_lock lock(mutex_);
    is_waiting_ = is_blocked_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !is_blocked_; });
    is_waiting_ = false;
    bytes = bytes.substr(0, most_);
    if (error_ != 0 && most_ == std::string::npos) {
      ++failures_;
      changed_.notify_all();
      errno = error_;
      return -1;
    }
    most_ = std::string::npos;
    text_ += bytes;
    return static_cast<ssize_t>(bytes.size());
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_blocked_ = false, is_waiting_ = false;
  int error_ = 0, failures_ = 0;
  size_t most_ = std::string::npos;  // of the next write
  std::string text_;
};

class LogWriterTest : public ::testing::Test {
 protected:
  ~LogWriterTest() override {
    output_.Release();
    output_.Fail(0);
    if (writer_) writer_->Flush(kLong);  // the thread uses the output
  }
  void Start(const LogWriter::Limits& limits = {}) {
    writer_.emplace(output_.Writing(), CountLineOf, limits,
                    [this] { return LogWriter::Clock::time_point(milliseconds(now_ms_)); });
  }

  std::atomic<int> now_ms_ = 0;
  Output output_;
  std::optional<LogWriter> writer_;
};

TEST_F(LogWriterTest, LinesKeepTheirOrder) {
  Start();
  std::vector<std::string> expected;
  for (int i = 0; i < 1000; ++i) {
    expected.push_back(std::to_string(i));
    writer_->Push(expected.back() + "\n");
  }
  ASSERT_TRUE(writer_->Flush(kLong));
  EXPECT_EQ(output_.Lines(), expected);
}

TEST_F(LogWriterTest, AStalledOutputStopsNobodyAndWhatItMissedIsCountedOnce) {
  Start({.lines = 3, .bytes = 1000});
  output_.Block();
  writer_->Push("being written\n");
  output_.AwaitBlocked();
  for (int i = 1; i <= 10; ++i) writer_->Push(fmt::format("{}\n", i));
  EXPECT_THAT(output_.Lines(), IsEmpty());
  now_ms_ = 2500;
  output_.Release();
  ASSERT_TRUE(writer_->Flush(kLong));
  writer_->Push("later\n");
  ASSERT_TRUE(writer_->Flush(kLong));
  EXPECT_THAT(output_.Lines(),
              ElementsAre("being written", "1", "2", "3", "7 left out in 2.5 s, error 0", "later"));
}

TEST_F(LogWriterTest, TheQueueIsBoundedInBytes) {
  Start({.lines = 1000, .bytes = 10});
  output_.Block();
  writer_->Push("first\n");
  output_.AwaitBlocked();
  for (int i = 0; i < 5; ++i) writer_->Push("1234\n");
  output_.Release();
  ASSERT_TRUE(writer_->Flush(kLong));
  EXPECT_THAT(output_.Lines(), ElementsAre("first", "1234", "1234", HasSubstr("3 left out")));
}

TEST_F(LogWriterTest, WhatFailedIsCountedAndToldWhenWritingWorksAgain) {
  Start();
  for (const int error : {EPIPE, EIO, ENOSPC}) {
    output_.Fail(error);
    for (int i = 0; i < 4; ++i) writer_->Push("lost\n");
    ASSERT_TRUE(writer_->Flush(kLong));
    now_ms_ += 1000;
    output_.Fail(0);
    writer_->Push("written\n");
    ASSERT_TRUE(writer_->Flush(kLong));
    EXPECT_THAT(output_.Lines(),
                ::testing::IsSupersetOf({fmt::format("4 left out in 1 s, error {}", error)}));
    EXPECT_EQ(output_.Lines().back(), "written");
  }
  EXPECT_EQ(output_.Lines().size(), 6u);
}

TEST_F(LogWriterTest, ALineThatWasWrittenInPartIsEnded) {
  Start();
  output_.Fail(EIO);
  output_.TakeAtMost(3);
  writer_->Push("broken off\n");
  ASSERT_TRUE(writer_->Flush(kLong));
  output_.Fail(0);
  writer_->Push("next\n");
  ASSERT_TRUE(writer_->Flush(kLong));
  EXPECT_THAT(output_.Lines(), ElementsAre("bro", StartsWith("1 left out"), "next"));
}

TEST_F(LogWriterTest, ShortWritesAreContinued) {
  Start();
  output_.TakeAtMost(2);
  writer_->Push("whole\n");
  ASSERT_TRUE(writer_->Flush(kLong));
  EXPECT_THAT(output_.Lines(), ElementsAre("whole"));
}

TEST_F(LogWriterTest, AFlushWaitsNoLongerThanItsLimit) {
  Start();
  output_.Block();
  writer_->Push("late\n");
  EXPECT_FALSE(writer_->Flush(milliseconds(1)));
  output_.AwaitBlocked();
  EXPECT_FALSE(writer_->Flush(milliseconds(1)));
  output_.Release();
  EXPECT_TRUE(writer_->Flush(kLong));
  EXPECT_THAT(output_.Lines(), ElementsAre("late"));
}

TEST_F(LogWriterTest, AFlushDoesNotWaitForLinesThatComeLater) {
  Start();
  std::atomic<bool> is_flushed = false;
  std::jthread talker([&] {
    while (!is_flushed) {
      writer_->Push("more\n");
      writer_->Push("and more\n");  // some line is always waiting
    }
  });
  EXPECT_TRUE(writer_->Flush(kLong));
  is_flushed = true;
}

// What the thread uses outlives the writer.
TEST(LogWriter, IsAbandonedWhileAWriteIsBlockedAndThenWritesTheRest) {
  const auto output = std::make_shared<Output>();
  const auto done = std::make_shared<std::promise<void>>();
  auto ended = done->get_future();
  output->Block();
  {
    // The last copy of the function goes with the thread.
    const std::shared_ptr<void> at_end(nullptr, [done](void*) { done->set_value(); });
    LogWriter writer(
        [output, at_end, write = output->Writing()](std::string_view bytes) { return write(bytes); },
        CountLineOf);
    writer.Push("first\n");
    writer.Push("second\n");
    output->AwaitBlocked();
  }
  output->Release();
  ended.wait();
  EXPECT_THAT(output->Lines(), ElementsAre("first", "second"));
}

/// A pipe, whose reading end the test reads or closes.
class LogPipe {
 public:
  LogPipe() { EXPECT_EQ(::pipe2(ends_, O_CLOEXEC), 0); }
  ~LogPipe() {
    CloseReader();
    ::close(ends_[1]);
  }
  int writer() const { return ends_[1]; }
  void CloseReader() {
    if (ends_[0] >= 0) ::close(ends_[0]);
    ends_[0] = -1;
  }
  /// Until `end` has come.
  std::string ReadUntil(std::string_view end) {
    std::string text;
    std::vector<char> block(size_t{1} << 16);
    while (text.find(end) == std::string::npos) {
      const ssize_t size = ::read(ends_[0], block.data(), block.size());
      if (size <= 0) break;
      text.append(block.data(), static_cast<size_t>(size));
    }
    return text;
  }

 private:
  int ends_[2] = {-1, -1};
};

TEST(LogWriter, APipeThatNobodyReadsStopsNobody) {
  for (const bool is_nonblocking : {false, true}) {
    LogPipe pipe;
    ASSERT_EQ(::fcntl(pipe.writer(), F_SETFL, is_nonblocking ? O_NONBLOCK : 0), 0);
    LogWriter writer(ToDescriptor(pipe.writer()), CountLineOf);
    constexpr int kLines = 10'000;
    for (int i = 0; i < kLines; ++i) writer.Push(fmt::format("{:6} {}\n", i, std::string(100, 'x')));
    EXPECT_FALSE(writer.Flush(milliseconds(0)));
    const std::vector<std::string> lines = SplitLines(pipe.ReadUntil("left out"));
    ASSERT_GT(lines.size(), 4096u);
    ASSERT_LT(lines.size(), size_t{kLines}) << "a pipe has less room";
    const size_t written = lines.size() - 1;
    for (size_t i = 0; i < written; ++i) ASSERT_EQ(std::stoul(lines[i]), i);
    EXPECT_THAT(lines.back(), StartsWith(fmt::format("{} left out", kLines - written)));
    writer.Push("later\n");
    EXPECT_THAT(pipe.ReadUntil("later\n"), HasSubstr("later\n"));
    ASSERT_TRUE(writer.Flush(kLong)) << "the thread uses the pipe";
  }
}

TEST(LogWriter, AReaderThatWentAwayIsAFailureLikeAnother) {
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  LogPipe pipe;
  pipe.CloseReader();
  const LogWriter::Write write = ToDescriptor(pipe.writer());
  EXPECT_EQ(write("x\n"), -1);
  EXPECT_EQ(errno, EPIPE);
  LogWriter writer(write, CountLineOf);
  writer.Push("lost\n");
  EXPECT_TRUE(writer.Flush(kLong));
  std::signal(SIGPIPE, before);
}

TEST(LogWriter, AFileIsAppendedToAndMadeWithItsFolder) {
  const std::filesystem::path folder = ::testing::TempDir() + "log_writer." + std::to_string(::getpid());
  for (const char* const line : {"one\n", "two\n"}) {
    auto file = ToFile(folder / "a" / "log");
    ASSERT_TRUE(file.ok()) << file.error().message;
    EXPECT_EQ((*file)(line), 4);
  }
  std::ifstream in(folder / "a" / "log");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "one\ntwo\n");
  EXPECT_EQ(ToFile(folder).error().code, ErrorCode::kInvalidArgument) << "no file";
  std::filesystem::remove_all(folder);
}

// The whole way: the macros, standard error, the end of the process.
TEST(LogWriter, StandardErrorThatNobodyReadsStopsNoThread) {
  const auto before = spdlog::default_logger();
  LogPipe pipe;
  const int saved = ::dup(STDERR_FILENO);
  ::dup2(pipe.writer(), STDERR_FILENO);
  ASSERT_TRUE(SetUpLog({.rates = {.per_site = 0, .total = 0}}).ok());
  for (int i = 0; i < 10'000; ++i) SPDLOG_WARN("{} {}", i, std::string(100, 'x'));
  EndLog(milliseconds(1));  // returns, whatever is left
  const std::string text = pipe.ReadUntil("left out");
  SPDLOG_WARN("after that");
  EXPECT_THAT(text + pipe.ReadUntil("after that"),
              HasSubstr("log lines were left out: the log was not read for"));
  EndLog(kLong);
  ::dup2(saved, STDERR_FILENO);
  ::close(saved);
  spdlog::set_default_logger(before);
}

TEST(LogWriter, TheEndTellsWhatTheRateLimitSuppressed) {
  const auto before = spdlog::default_logger();
  const std::string file = ::testing::TempDir() + "log_end." + std::to_string(::getpid());
  ASSERT_TRUE(SetUpLog({.file = file, .rates = {.per_site = 1}}).ok());
  for (int i = 0; i < 3; ++i) SPDLOG_WARN("again");
  EndLog(kLong);
  spdlog::set_default_logger(before);
  std::ifstream in(file);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  EXPECT_THAT(SplitLines(text), ElementsAre(HasSubstr("again"), HasSubstr("again (… 2 more)")));
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace taclink::server
