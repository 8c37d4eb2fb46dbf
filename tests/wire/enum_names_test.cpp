#include "wire/enum_names.h"

#include <gmock/gmock.h>

#include <set>

#include "taclink/v1/contacts.pb.h"
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

TEST(EnumNames, ZeroHasANameThatNoOtherValueHas) {
  EXPECT_STREQ(NamesOf<v1::PoseValidity>().Name(v1::POSE_VALIDITY_UNSPECIFIED), "unspecified");
  EXPECT_STREQ(NamesOf<v1::PoseValidity>().Name(v1::POSE_VALIDITY_UNKNOWN), "unknown");
  const auto& file = *v1::PoseValidity_descriptor()->file();
  for (const auto* proto : {&file, v1::EventKind_descriptor()->file(), v1::Detail_descriptor()->file()}) {
    for (int i = 0; i < proto->enum_type_count(); ++i) {
      const EnumNames names(*proto->enum_type(i));
      std::set<std::string> different = {names.Name(0)};
      for (const std::string& name : names.All()) EXPECT_TRUE(different.insert(name).second) << name;
    }
  }
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
