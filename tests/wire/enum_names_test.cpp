#include "wire/enum_names.h"

#include <gmock/gmock.h>

#include "taclink/v1/events.pb.h"
#include "taclink/v1/frame.pb.h"

namespace taclink::wire {
namespace {

using ::testing::ElementsAre;

TEST(EnumNames, AreThoseOfTheProto) {
  const EnumNames& names = NamesOf<v1::EventKind>();
  EXPECT_STREQ(names.Name(v1::EVENT_KIND_FORCE_MODEL), "force_model");
  EXPECT_STREQ(names.Name(v1::EVENT_KIND_CAMERA), "camera");
  EXPECT_EQ(names.Number("contact_begin"), v1::EVENT_KIND_CONTACT_BEGIN);
  EXPECT_THAT(NamesOf<v1::ForceLevel>().All(), ElementsAre("normal", "warning", "alarm"));
}

TEST(EnumNames, NumbersAndNamesThatAreNotThere) {
  const EnumNames& names = NamesOf<v1::EventKind>();
  EXPECT_STREQ(names.Name(0), "unknown");
  EXPECT_STREQ(names.Name(-1), "unknown");
  EXPECT_STREQ(names.Name(1000), "unknown");
  EXPECT_EQ(names.Number("unknown"), std::nullopt);
  EXPECT_EQ(names.Number("unspecified"), std::nullopt);
  EXPECT_EQ(names.Number(""), std::nullopt);
}

}  // namespace
}  // namespace taclink::wire
