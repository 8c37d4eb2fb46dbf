#include "sensing/yaml/yaml_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

template <typename Read>
std::string ErrorsOf(const std::string& text, const Read& read) {
  auto file = YamlFile::Parse("f.yaml", text);
  if (!file) return file.error().message;
  read(file->root());
  file->root().Done();
  const auto finished = file->Finish();
  return finished.ok() ? "" : finished.error().message;
}

TEST(YamlReader, AllErrorsAreInTheOrderOfTheFile) {
  const auto read = [](YamlMap& root) {
    root.Integer("c", {.min = 1});
    root.Number("b");
    root.Integers("a", 2, {.min = 0});
  };
  EXPECT_EQ(ErrorsOf("a: [x, -1]\nb: y\nc: 0\nd: 1\nd: 2\n", read),
            "f.yaml:1: 'a' must be whole numbers, not 'x'\n"
            "f.yaml:2: 'b' must be a number, not 'y'\n"
            "f.yaml:3: 'c' must be at least 1, not 0\n"
            "f.yaml:4: 'd' is not a known key here; known are: a, b, c\n"
            "f.yaml:5: 'd' stands here a second time");
  EXPECT_EQ(ErrorsOf("a: [0, 1]\nb: 2\nc: 3\n", read), "");
}

TEST(YamlReader, AMisspelledKeyComesBeforeTheMissingOne) {
  EXPECT_EQ(ErrorsOf("one: 1\ntwo: {nmae: x}\n",
                     [](YamlMap& root) {
                       root.Integer("one");
                       YamlMap two = root.Map("two");
                       two.Text("name");
                       two.Done();
                     }),
            "f.yaml:2: 'two.nmae' is not a known key here; known are: name\n"
            "f.yaml:2: 'two.name' is missing");
}

TEST(YamlReader, AMissingMappingIsOneError) {
  EXPECT_EQ(ErrorsOf("a: 1\n",
                     [](YamlMap& root) {
                       root.Integer("a");
                       YamlMap inner = root.Map("outer").Map("inner");
                       inner.Number("b");
                       inner.Choice("c", {"x", "y"});
                       inner.Fail("b", "is odd");
                     }),
            "f.yaml:1: 'outer' is missing");
}

TEST(YamlReader, AStatementAboutValuesThatFailedIsNotReported) {
  const auto read = [](YamlMap& root) {
    root.Number("low");
    root.Number("high");
    root.Fail("high", "must be above low", {"low"});
  };
  EXPECT_EQ(ErrorsOf("low: x\nhigh: 1\n", read), "f.yaml:1: 'low' must be a number, not 'x'");
  EXPECT_EQ(ErrorsOf("low: 2\nhigh: 1\n", read), "f.yaml:2: 'high' must be above low");
}

TEST(YamlReader, AFileOfAnotherKindDoesNotFillTheScreen) {
  std::string text;
  for (int i = 0; i < 150; ++i) text += "k" + std::to_string(i) + ": 1\n";
  const std::string errors = ErrorsOf(text, [](YamlMap&) {});
  EXPECT_THAT(errors, HasSubstr("f.yaml:1: 'k0' is not a known key here"));
  EXPECT_THAT(errors, EndsWith("\nf.yaml: has 50 more errors"));
}

}  // namespace
}  // namespace taclink
