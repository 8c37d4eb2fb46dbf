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

// What nests, `depth` times: flow and block, lists and mappings.
std::string Nested(const std::string& form, int depth) {
  std::string text = "a: ";
  for (int i = 0; i < depth; ++i) {
    if (form == "block") text += "\n" + std::string(static_cast<size_t>(i) + 1, ' ') + "b:";
    if (form == "dash") text += (i == 0 ? "\n" : "") + std::string("- ");
    if (form == "[" || form == "{b: " || form == "[{b: ") text += form;
  }
  text += " 1";
  for (int i = 0; i < depth; ++i)
    text += form == "[" ? "]" : form == "{b: " ? "}" : form == "[{b: " ? "}]" : "";
  return text;
}

TEST(YamlReader, DepthIsLimitedBeforeTheParserRecurses) {
  for (const std::string form : {"[", "{b: ", "block", "dash"}) {
    EXPECT_TRUE(YamlFile::Parse("f.yaml", Nested(form, 99)).ok()) << form << ", with the root 100";
    for (const int depth : {100, 600, form == "block" ? 1000 : 40'000}) {
      const auto file = YamlFile::Parse("f.yaml", Nested(form, depth));
      ASSERT_FALSE(file.ok()) << form << depth;
      EXPECT_THAT(file.error().message, HasSubstr("f.yaml:")) << form;
      EXPECT_THAT(file.error().message, HasSubstr("nested to a depth of more than 100")) << form << depth;
    }
  }
  EXPECT_THAT(YamlFile::Parse("f.yaml", Nested("[{b: ", 20'000)).error().message, HasSubstr("more than 100"));
}

TEST(YamlReader, SizeIsLimited) {
  const auto file = YamlFile::Parse("f.yaml", std::string((size_t{16} << 20) + 1, '#'));
  ASSERT_FALSE(file.ok());
  EXPECT_THAT(file.error().message, HasSubstr("16777217 bytes; at most 16777216"));
}

}  // namespace
}  // namespace taclink
