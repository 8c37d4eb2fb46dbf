#include <gtest/gtest.h>

#include "client/command/cli/csv.h"
#include "client/command/logs/log_source.h"
#include "client/command/logs/trace.h"

namespace taclink::command {
namespace {

constexpr uint64_t kStartNs = 1'000'000'000'000;

TEST(LogTime, IsSecondsFromTheStartOrUtc) {
  const std::pair<const char*, uint64_t> times[] = {
      {"0", kStartNs},
      {"2.5", kStartNs + 2'500'000'000},
      {"1e-9", kStartNs + 1},
      {"1970-01-01T00:00:01Z", 1'000'000'000},
      {"2026-01-02T03:04:05Z", 1'767'323'045'000'000'000},
      {"2026-01-02T03:04:05.25Z", 1'767'323'045'250'000'000},
      {"2026-01-02 03:04:05.250 UTC", 1'767'323'045'250'000'000},
      {"2024-02-29T23:59:59.123456789Z", 1'709'251'199'123'456'789}};
  for (const auto& [text, utc_ns] : times) {
    const auto time = ParseLogTime(text, kStartNs);
    ASSERT_TRUE(time.ok()) << time.error().message;
    EXPECT_EQ(*time, utc_ns) << text;
  }
  for (const char* text :
       {"", "x", "-1", "nan", "inf", "1e12", "1 s", "2026-01-02", "2026-01-02T03:04:05",
        "2026-13-01T00:00:00Z", "2025-02-29T00:00:00Z", "1969-12-31T23:59:59Z", "2026-01-02T25:00:00Z",
        "2026-01-02T00:60:00Z", "2026-01-02T00:00:00.1234567890Z", "9999-01-01T00:00:00Z"})
    EXPECT_FALSE(ParseLogTime(text, kStartNs).ok()) << text;
  EXPECT_EQ(*ParseLogTime("5", UINT64_MAX - 1), UINT64_MAX) << "a damaged log's start";
}

TEST(CsvCell, IsQuotedWhereItMustBe) {
  EXPECT_EQ(CsvCell("plain text"), "plain text");
  EXPECT_EQ(CsvCell("a,b"), "\"a,b\"");
  EXPECT_EQ(CsvCell("say \"no\""), "\"say \"\"no\"\"\"");
  EXPECT_EQ(CsvCell("two\nlines"), "\"two\nlines\"");
}

TEST(Trace, DecimatedKeepsTheExtremesOfEachColumn) {
  constexpr size_t kColumns = 10, kPoints = 10'000;
  Trace trace(0, 1, kColumns);
  std::vector<double> least(kColumns, 1e9), most(kColumns, -1e9);
  for (size_t i = 0; i < kPoints; ++i) {
    if (i == kPoints / 2) trace.Decimate();  // what is there before and what comes after are treated alike
    const double time_s = (static_cast<double>(i) + 0.5) / kPoints;
    const double value = i % 1777 == 3 ? 100.0 + static_cast<double>(i) : std::sin(static_cast<double>(i));
    const size_t column = i * kColumns / kPoints;
    least[column] = std::min(least[column], value);
    most[column] = std::max(most[column], value);
    trace.Add(time_s, value);
  }
  const auto points = trace.Points();
  ASSERT_EQ(points.size(), 2 * kColumns);
  for (size_t i = 0; i < kColumns; ++i) {
    EXPECT_LT(points[2 * i].time_s, points[2 * i + 1].time_s);
    EXPECT_EQ(std::min(points[2 * i].value, points[2 * i + 1].value), least[i]);
    EXPECT_EQ(std::max(points[2 * i].value, points[2 * i + 1].value), most[i]);
    EXPECT_EQ(points[2 * i].begins, i == 0);
  }
}

TEST(Trace, IsBrokenWhereNothingWasMeasured) {
  for (const bool decimated : {false, true}) {
    Trace trace(0, 10, 10);
    if (decimated) trace.Decimate();
    for (const double value : {1.0, 2.0, std::nan(""), std::nan(""), 3.0, 4.0})
      trace.Add(value == value ? value : 2.5, value);
    const auto points = trace.Points();
    ASSERT_EQ(points.size(), 4u);
    for (size_t i = 0; i < points.size(); ++i) EXPECT_EQ(points[i].begins, i == 0 || i == 2) << i;
  }
}

}  // namespace
}  // namespace taclink::command
