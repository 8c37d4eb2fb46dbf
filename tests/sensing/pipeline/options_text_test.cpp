#include "sensing/pipeline/options_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace taclink {
namespace {

using ::testing::HasSubstr;

void ExpectSame(const PipelineOptions& a, const PipelineOptions& b) {
  EXPECT_EQ(a.force.model, b.force.model);
  EXPECT_EQ(a.force.refinement, b.force.refinement);
  EXPECT_EQ(a.pressure_mpa, b.pressure_mpa);
  EXPECT_EQ(a.pictures_may_repeat, b.pictures_may_repeat);
  ASSERT_EQ(a.drift.has_value(), b.drift.has_value());
  if (!a.drift) return;
  EXPECT_EQ(a.drift->time_constant_s, b.drift->time_constant_s);
  EXPECT_EQ(a.drift->rate_limit_mm_s, b.drift->rate_limit_mm_s);
  EXPECT_EQ(a.drift->limit_mm, b.drift->limit_mm);
  EXPECT_EQ(a.drift->stop_n, b.drift->stop_n);
  EXPECT_EQ(a.drift->go_n, b.drift->go_n);
  EXPECT_EQ(a.drift->quiet_s, b.drift->quiet_s);
}

TEST(OptionsTextTest, ReadsBackToTheSameNumbers) {
  PipelineOptions options;
  options.force.model.reset();
  options.force.refinement = 3;
  options.pressure_mpa = 0.1 + 0.2;  // all bits are in use
  options.pictures_may_repeat = true;
  options.drift = DriftOptions{.time_constant_s = 1.0 / 3,
                               .rate_limit_mm_s = std::nextafter(0.001, 1),
                               .limit_mm = 1e-300,
                               .stop_n = 3e5,
                               .go_n = std::nextafter(3e5, 0),
                               .quiet_s = 86400};
  const auto back = ParseOptionsText(OptionsText(options));
  ASSERT_TRUE(back.ok()) << back.error().message;
  ExpectSame(*back, options);
}

TEST(OptionsTextTest, EveryForceModelAndNoDrift) {
  for (const ForceModel model : kForceModels) {
    PipelineOptions options;
    options.force.model = model;
    const auto text = OptionsText(options);
    EXPECT_EQ(text.at("force.model"), Name(model));
    EXPECT_EQ(text.at("drift.follow"), "false");
    const auto back = ParseOptionsText(text);
    ASSERT_TRUE(back.ok()) << back.error().message;
    ExpectSame(*back, options);
  }
  PipelineOptions any;
  any.force.model.reset();
  EXPECT_EQ(OptionsText(any).at("force.model"), "auto");
}

TEST(OptionsTextTest, WhatIsNotUnderstoodIsRefusedByName) {
  PipelineOptions options;
  options.drift.emplace();
  const auto good = OptionsText(options);
  ASSERT_TRUE(ParseOptionsText(good).ok());
  const auto refused = [&](const std::string& key, const std::string& value) {
    auto text = good;
    text[key] = value;
    const auto read = ParseOptionsText(text);
    ASSERT_FALSE(read.ok()) << key << " " << value;
    EXPECT_EQ(read.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(read.error().message, HasSubstr(key));
  };
  refused("force.model", "magic");
  refused("force.refinement", "4");
  refused("force.refinement", "1.5");
  refused("pictures_may_repeat", "maybe");
  refused("pressure_mpa", "");
  refused("pressure_mpa", "0.01 MPa");
  refused("pressure_mpa", "nan");
  refused("pressure_mpa", "inf");
  refused("drift.follow", "yes");
  refused("drift.quiet_s", "-1");
  refused("drift.go_n", good.at("drift.stop_n"));
  refused("from.the.future", "1");
  for (const auto& [key, value] : good) {
    auto text = good;
    text.erase(key);
    const auto read = ParseOptionsText(text);
    ASSERT_FALSE(read.ok()) << key;
    EXPECT_THAT(read.error().message, HasSubstr(key));
  }
}

}  // namespace
}  // namespace taclink
