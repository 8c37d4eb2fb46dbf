#include "sensing/core/marker_text.h"

#include <gtest/gtest.h>

#include <vector>

namespace taclink {
namespace {

constexpr int kPaths = 24;

int At(int path, int ring) {  // from 1
  return (ring - 1) * kPaths + path - 1;
}

std::string TextOf(const std::vector<int>& markers) {
  return MarkerText(markers, kPaths);
}

TEST(MarkerText, ListsRingsByPath) {
  EXPECT_EQ(TextOf({}), "");
  EXPECT_EQ(TextOf({At(3, 10)}), "path 3, ring 10");
  EXPECT_EQ(TextOf({At(7, 6), At(3, 4), At(7, 4), At(7, 5), At(7, 1)}),
            "path 3, ring 4; path 7, rings 1, 4 to 6");
}

TEST(MarkerText, EndsALongListWithWhatIsLeft) {
  std::vector<int> markers;
  for (int path = 1; path <= 12; ++path) {
    markers.push_back(At(path, 2));
    markers.push_back(At(path, 5));
  }
  const std::string text = TextOf(markers);
  EXPECT_TRUE(text.starts_with("path 1, rings 2, 5; path 2, rings 2, 5;")) << text;
  EXPECT_TRUE(text.ends_with("path 8, rings 2, 5; and 8 more")) << text;
}

}  // namespace
}  // namespace taclink
