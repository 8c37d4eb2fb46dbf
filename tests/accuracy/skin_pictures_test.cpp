// Every shipped skin inflated and pressed, from good and poor pictures through the whole way.
#include <gtest/gtest.h>

#include "bench/stability/stability_cases.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class SkinPictures : public ::testing::TestWithParam<std::string> {};

TEST_P(SkinPictures, EndRight) {
  const LinkModel base = LoadLinkModel("cylinder").value();
  int cases = 0;
  for (const SkinCase& skin : PictureCases(base)) {
    if (skin.model.name != GetParam() || !skin.name.ends_with(", 1.5 kPa")) continue;
    for (const StabilityRow& row : RunPictureCase(skin)) {
      ++cases;
      EXPECT_EQ(row.ending, Ending::kRight) << row.name << ": " << row.reason;
      EXPECT_EQ(row.reason, "ok") << row.name;
    }
  }
  EXPECT_EQ(cases, 2);
}

INSTANTIATE_TEST_SUITE_P(Shipped, SkinPictures, ::testing::ValuesIn(ShippedModelNames()),
                         [](const auto& name) { return name.param; });

}  // namespace
}  // namespace taclink
