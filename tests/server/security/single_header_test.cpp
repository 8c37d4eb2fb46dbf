#include "server/security/single_header.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <initializer_list>
#include <utility>

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

Result<std::string_view> ValueIn(
    std::initializer_list<std::pair<std::string_view, std::string_view>> headers) {
  SingleHeader header("authorization");
  for (const auto& [name, value] : headers) header.Read(name, value);
  return header.Value();
}

TEST(SingleHeader, IsTheOnlyOneOfItsName) {
  EXPECT_EQ(*ValueIn({}), "");
  EXPECT_EQ(*ValueIn({{":path", "/a"}, {"authorization", "Bearer a"}, {"authorization2", "b"}}), "Bearer a");
}

TEST(SingleHeader, SeveralAreRefusedWhateverTheyHold) {
  for (const char* second : {"Bearer b", "Bearer a", ""}) {
    const auto value = ValueIn({{"authorization", "Bearer a"}, {":path", "/a"}, {"authorization", second}});
    ASSERT_FALSE(value.ok()) << second;
    EXPECT_EQ(value.error().code, ErrorCode::kUnauthenticated);
    EXPECT_THAT(value.error().message, HasSubstr("2 'authorization' headers"));
    EXPECT_THAT(value.error().message, ::testing::Not(HasSubstr("Bearer"))) << "no secrets";
  }
}

}  // namespace
}  // namespace taclink::server
