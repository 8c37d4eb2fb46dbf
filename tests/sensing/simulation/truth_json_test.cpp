#include "sensing/simulation/truth_json.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <sstream>

#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

TEST(TruthJson, OneLineThatReadsBack) {
  const LinkModel model = Model("cylinder");
  const SkinTruth truth = TruthAt(
      model,
      SceneWith(
          "pressure_kpa: 0.5\ncontacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 0, end_s: 4}\n"),
      2);
  std::ostringstream out;
  WriteTruthLine(truth, model.RestMarkers(), out);
  const std::string line = out.str();
  EXPECT_EQ(line.find('\n'), line.size() - 1);
  const YAML::Node json = YAML::Load(line);  // YAML contains JSON
  EXPECT_EQ(json["frame"].as<int>(), 60);
  EXPECT_NEAR(json["time_s"].as<double>(), 2, 1e-9);
  EXPECT_NEAR(json["pressure_kpa"].as<double>(), 0.5, 1e-9);
  ASSERT_EQ(json["contacts"].size(), 1U);
  const YAML::Node contact = json["contacts"][0];
  EXPECT_NEAR(contact["force_n"][1].as<double>(), -0.2, 1e-3);
  EXPECT_NEAR(contact["depth_mm"].as<double>(), truth.contacts[0].depth_mm, 1e-5);
  EXPECT_NEAR(contact["center_mm"][2].as<double>(), truth.contacts[0].center_mm.z(), 1e-5);
  EXPECT_NEAR(contact["normal"][1].as<double>(), 1, 0.05);
  EXPECT_FALSE(contact["limited"].as<bool>());
  ASSERT_EQ(json["markers_mm"].size(), 240U);
  const auto marker = static_cast<size_t>(model.MarkerIndex(6, 4));
  EXPECT_NEAR(json["markers_mm"][marker][1].as<double>() - json["displacements_mm"][marker][1].as<double>(),
              model.RestMarker(static_cast<int>(marker)).y(), 2e-6);
}

}  // namespace
}  // namespace taclink
