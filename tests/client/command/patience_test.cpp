#include "client/cpp/patience.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

class PatienceTest : public ::testing::Test {
 protected:
  ~PatienceTest() override {
    if (before_.empty()) {
      unsetenv(kName);
    } else {
      setenv(kName, before_.c_str(), 1);
    }
  }
  static Result<milliseconds> With(const char* value) {
    setenv(kName, value, 1);
    return PatienceFromEnvironment(milliseconds(3000));
  }

  static constexpr const char* kName = "TACLINK_PATIENCE_S";
  const std::string before_ = std::getenv(kName) ? std::getenv(kName) : "";
};

TEST_F(PatienceTest, RaisesALimitAndNeverLowersIt) {
  unsetenv(kName);
  EXPECT_EQ(PatienceFromEnvironment(milliseconds(3000)).value(), milliseconds(3000));
  EXPECT_EQ(With("").value(), milliseconds(3000));
  EXPECT_EQ(With("2").value(), milliseconds(3000));
  EXPECT_EQ(With("4.5").value(), milliseconds(4500));
  EXPECT_EQ(With("1e300").value(), milliseconds(86'400'000))
      << "a day at most: deadlines overflow far beyond";
}

TEST_F(PatienceTest, BadValuesAreRefused) {
  for (const char* value : {"abc", "0", "-1", "nan", "inf", "60 s", " 60"}) {
    const auto patience = With(value);
    ASSERT_FALSE(patience.ok()) << value;
    EXPECT_EQ(patience.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(patience.error().message, HasSubstr(std::string("'") + value + "'"));
  }
}

}  // namespace
}  // namespace taclink::client
