#include "server/process/system_limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <boost/system/system_error.hpp>
#include <cerrno>
#include <future>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string Described(int error) {
  const std::string text = DescribeLimit(std::system_error(error, std::generic_category()));
  EXPECT_EQ(DescribeLimit(std::system_error(error, std::system_category())), text);
  return text;
}

TEST(SystemLimits, AThreadThatCannotBeStartedNamesWhatLimitsThreads) {
  const auto names_limits =
      AllOf(HasSubstr("no thread can be started"), HasSubstr("threads of this process: "),
            HasSubstr("TasksMax"), HasSubstr("pids.max"), HasSubstr("ulimit -u "));
  EXPECT_THAT(Described(EAGAIN), AllOf(names_limits, HasSubstr("Resource temporarily unavailable")));
  // As Asio's thread pools say it.
  EXPECT_THAT(DescribeLimit(boost::system::system_error(EAGAIN, boost::system::system_category(), "thread")),
              AllOf(names_limits, HasSubstr("thread: ")));
}

TEST(SystemLimits, DescriptorsAndMemoryAreNamedWithTheirValue) {
  rlimit files{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &files), 0);
  const std::string value = files.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(files.rlim_cur);
  EXPECT_THAT(Described(EMFILE), AllOf(HasSubstr("LimitNOFILE"), HasSubstr("(ulimit -n " + value + ")")));
  EXPECT_THAT(Described(ENFILE), HasSubstr("fs.file-max "));
  const auto names_memory =
      AllOf(HasSubstr("out of memory"), HasSubstr("MemoryMax"), HasSubstr("ulimit -v "));
  EXPECT_THAT(Described(ENOMEM), names_memory);
  EXPECT_THAT(DescribeLimit(std::bad_alloc()), names_memory);
  EXPECT_THAT(DescribeLimit(std::bad_array_new_length()), names_memory);
}

TEST(SystemLimits, OtherErrorsSayWhatTheySay) {
  EXPECT_EQ(DescribeLimit(std::runtime_error("no such thing")), "no such thing");
  EXPECT_EQ(Described(EINVAL), "Invalid argument");
  const std::system_error other(EAGAIN, std::future_category());
  EXPECT_EQ(DescribeLimit(other), other.what()) << "another category numbers other errors";
}

}  // namespace
}  // namespace taclink::server
