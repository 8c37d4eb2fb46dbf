#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string_view>

namespace taclink::testing {

/// In CI a missing prerequisite is an error, because a skipped test would hide it.
inline bool IsCi() {
  const char* const ci = std::getenv("CI");
  return ci != nullptr && std::string_view(ci) == "true";
}

}  // namespace taclink::testing

/// For a test, or its SetUp, that not every machine can run. `message`: what is missing and what to do.
#define TACLINK_REQUIRE(available, message)              \
  do {                                                   \
    if (!(available)) {                                  \
      if (::taclink::testing::IsCi()) FAIL() << message; \
      GTEST_SKIP() << message;                           \
    }                                                    \
  } while (false)
