// taclink log plot, on logs of known content.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "client/command/logs/force_plot.h"
#include "tests/client/command/log_content.h"

namespace taclink::testing {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

// What an XML parser finds in an SVG: for each panel its name, the curves as lists of pieces, and the number
// of marks.
json Parsed(const std::string& path) {
  const Finished run = RunToEnd({"/usr/bin/env", "python3", "-c", R"(
import json, re, sys
import xml.etree.ElementTree as xml
svg = '{http://www.w3.org/2000/svg}'
def pieces(path):
    return [len(re.findall('L', piece)) + 1 for piece in path.get('d').split('M')[1:]]
root = xml.parse(sys.argv[1]).getroot()
panels = []
for group in root.findall(svg + 'g'):
    panel = {'texts': [t.text for t in group.iter(svg + 'text')], 'total': [], 'contact': [], 'begin': 0, 'end': 0}
    for path in group.iter(svg + 'path'):
        kind = path.get('class')
        if kind in ('total', 'contact'): panel[kind].append(pieces(path))
        else: panel[kind] += 1
    panels.append(panel)
print(json.dumps({'panels': panels, 'texts': [t.text for t in root.iter(svg + 'text')]}))
)",
                                 path});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  return json::parse(run.out, nullptr, false);
}

class LogPlotTest : public LogToolTest {
 protected:
  const std::string log_ = Path("log.mcap"), svg_ = Path("out.svg");
};

TEST_F(LogPlotTest, HasAPanelForEachLink) {
  WriteLog(log_);
  LogDoes({"plot", log_, "-o", svg_});
  const json plot = Parsed(svg_);
  EXPECT_THAT(plot.at("texts").dump(),
              AllOf(HasSubstr("log.mcap: from 2026-01-02 03:04:05.000 UTC"), HasSubstr("force, N"),
                    HasSubstr("time since the log's start, s")));
  ASSERT_EQ(plot.at("panels").size(), 2u);
  const json &lower = plot.at("panels")[0], &upper = plot.at("panels")[1];
  EXPECT_THAT(lower.at("texts").dump(), HasSubstr("lower"));
  EXPECT_THAT(upper.at("texts").dump(), HasSubstr("upper"));
  EXPECT_EQ(lower.at("total"), json({{kFrames}}));
  EXPECT_EQ(lower.at("contact"), json({{kFrames}, {kFrames}}));
  EXPECT_EQ(upper.at("total"), json({{50, 45}})) << "broken where nothing was measured";
  EXPECT_EQ(upper.at("contact"), json({{20}}));
  EXPECT_EQ(upper.at("begin"), 1);
  EXPECT_EQ(upper.at("end"), 1);
  EXPECT_EQ(lower.at("begin"), 0);
}

TEST_F(LogPlotTest, DrawsAPart) {
  WriteLog(log_);
  LogDoes({"plot", log_, "-o", svg_, "--link", "upper", "--from", "3", "--to", "4.5"});
  const json plot = Parsed(svg_);
  ASSERT_EQ(plot.at("panels").size(), 1u);
  EXPECT_EQ(plot.at("panels")[0].at("total"), json({{15}}));
  EXPECT_EQ(plot.at("panels")[0].at("contact"), json({{10}}));
  EXPECT_EQ(plot.at("panels")[0].at("begin"), 0);
  EXPECT_EQ(plot.at("panels")[0].at("end"), 1);
}

TEST_F(LogPlotTest, LongLogsAreDecimated) {
  WriteLog(log_, {.pictures = false, .frames = 5000});
  LogDoes({"plot", log_, "-o", svg_});
  const json plot = Parsed(svg_);
  const json& lower = plot.at("panels")[0];
  const int points = lower.at("total")[0][0];
  EXPECT_GT(points, 800);
  EXPECT_LT(points, 2000);
  EXPECT_EQ(plot.at("panels")[1].at("total")[0].size(), 2u) << "the short gap is still there";
}

TEST_F(LogPlotTest, WhatCannotBeIsRefusedAndNothingIsLeftBehind) {
  WriteLog(log_);
  EXPECT_THAT(Log({"plot", log_, "-o", svg_, "--link", "x"}).err, HasSubstr("lower, upper"));
  LogDoes({"cut", log_, "-o", Path("joints.mcap"), "--only-topics", "/joint_states"});
  const Finished empty = Log({"plot", Path("joints.mcap"), "-o", svg_});
  EXPECT_EQ(empty.exit_code, 1);
  EXPECT_THAT(empty.err, HasSubstr("no frames"));
  EXPECT_FALSE(Exists("out.svg"));
  LogDoes({"plot", log_, "-o", svg_});
  const std::string before = FileText(svg_);
  EXPECT_EQ(Log({"plot", log_, "-o", svg_, "--link", "upper"}).exit_code, 1);
  EXPECT_EQ(FileText(svg_), before);
}

TEST_F(LogPlotTest, ATruncatedLogIsDrawnAsFarAsItGoes) {
  WriteLog(log_);
  const Finished run = Log({"plot", Truncated(log_, 0.6), "-o", svg_});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("taclink log recover"));
  EXPECT_EQ(Parsed(svg_).at("panels").size(), 2u);
}

TEST(ForcePlot, SaysWhereNothingWasMeasured) {
  command::ForcePlot plot("log", 0, 10);
  plot.AddFrame("upper", 1, std::nullopt, {});
  EXPECT_THAT(plot.Svg(), HasSubstr(">nothing was measured<"));
}

TEST(ForcePlot, NamesAreEscapedAndWhatIsNotDrawnIsSaid) {
  command::ForcePlot plot("a<b> & \"c\"", 0, 10);
  for (size_t i = 0; i < command::ForcePlot::kMostContacts + 3; ++i)
    plot.AddFrame("<x>", 10.0 * static_cast<double>(i) / 6000, 1, {{.id = i, .magnitude_n = 1}});
  EXPECT_THAT(plot.Svg(),
              AllOf(HasSubstr("a&lt;b&gt; &amp;"), HasSubstr("&lt;x&gt; (3 more contacts are not drawn")));
}

}  // namespace
}  // namespace taclink::testing
