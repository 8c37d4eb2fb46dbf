// Shipped designs have no fault, and spoilt ones have the fault that was put into them.
#include <gmock/gmock.h>

#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "sensing/design/skin_check.h"
#include "tests/sensing/design/design_models.h"

namespace taclink {
namespace {

struct BrokenDesign {
  std::string name;
  std::string shipped;
  std::vector<std::pair<std::string, std::string>> replacements;
  std::string fault;   // id of the finding
  std::string change;  // a part of what it says to change

  friend std::ostream& operator<<(std::ostream& out, const BrokenDesign& design) {
    return out << design.name;
  }
};

std::vector<Finding> FindingsFor(const LinkModel& model, bool with_mechanics = true) {
  const auto design = AnalyzeSkin(model, {.with_mechanics = with_mechanics});
  EXPECT_TRUE(design.ok());
  return design.ok() ? FindingsOf(*design) : std::vector<Finding>();
}

std::string Listed(const std::vector<Finding>& findings, Severity least) {
  std::string list;
  for (const Finding& finding : findings) {
    if (finding.severity >= least)
      list += std::string(Name(finding.severity)) + " " + finding.id + ": " + finding.what + " -> " +
              finding.change + "\n";
  }
  return list;
}

class ShippedDesign : public ::testing::TestWithParam<std::string> {};

TEST_P(ShippedDesign, HasNoFault) {
  const std::string faults = Listed(FindingsFor(LoadLinkModel(GetParam()).value()), Severity::kFault);
  EXPECT_EQ(faults, "");
}

INSTANTIATE_TEST_SUITE_P(Models, ShippedDesign, ::testing::Values("cylinder", "barrel", "bottle", "cone"),
                         [](const auto& shipped) { return shipped.param; });

class BrokenDesignTest : public ::testing::TestWithParam<BrokenDesign> {};

TEST_P(BrokenDesignTest, NamesItsFault) {
  const BrokenDesign& broken = GetParam();
  const bool is_of_mechanics = broken.fault == "pressure_limit" || broken.fault == "least_force";
  const std::vector<Finding> findings =
      FindingsFor(Altered(broken.shipped, broken.replacements), is_of_mechanics);
  const auto found = std::ranges::find_if(findings, [&](const Finding& finding) {
    return finding.id == broken.fault && finding.severity == Severity::kFault;
  });
  ASSERT_NE(found, findings.end()) << broken.fault << " is not among\n"
                                   << Listed(findings, Severity::kWarning);
  EXPECT_THAT(found->change, ::testing::HasSubstr(broken.change)) << found->what;
  EXPECT_EQ(findings.front().severity, Severity::kFault) << "faults come first";
}

const std::vector<BrokenDesign> kBroken = {
    {"MarkersTooSmall",
     "cylinder",
     {{"diameter_mm: 2.8", "diameter_mm: 2"}, {"4.09", "3.92"}},
     "marker_too_small",
     "a marker diameter of at least 2.8 mm"},
    {"LinkTooLong",
     "cylinder",
     {{"length_mm: 198", "length_mm: 270"}, {"count: 10", "count: 14"}, {"226.49]", "296.5]"}},
     "marker_too_small",
     "or a length of at most 2"},
    {"CameraTooFarInside",
     "cylinder",
     {{"[0, 0, -26.5]", "[0, 0, 30]"}},
     "camera_inside_skin",
     "at least 30.0 mm further out"},
    {"CameraTurnedRound",
     "cylinder",
     {{"position_mm: [0, 0, -26.5]", "position_mm: [0, 0, -26.5]\n    rotation_deg: [180, 0, 0]"}},
     "camera_direction",
     "rotation_deg: [0, 0, 0]"},
    {"CameraAtTheWrongEnd", "cylinder", {{"[0, 0, -26.5]", "[0, 0, 226.5]"}}, "camera_at_wrong_end", "swap"},
    {"CameraInTheCavity", "cylinder", {{"[0, 0, -26.5]", "[0, 25, 4]"}}, "camera_inside_skin", "further out"},
    {"TubeTooThick",
     "cylinder",
     {{"outer_radius_mm: 15", "outer_radius_mm: 30"}},
     "marker_behind_tube",
     "a tube of at most"},
    {"WallTooThin",
     "bottle",
     {{"thickness_mm: 3.5", "thickness_mm: 1.2"}, {"center_depth_mm: 4.1", "center_depth_mm: 1.8"}},
     "pressure_limit",
     "a wall of at least"},
    {"WallTooStiff",
     "cylinder",
     {{"youngs_modulus_mpa: 0.1002", "youngs_modulus_mpa: 2"}},
     "least_force",
     "a modulus of at most"},
    {"NeckHidesMarkers",
     "bottle",
     {{"[39.5, 39.5, 39, 37.5, 33, 29]", "[39.5, 39.5, 39, 36, 26, 39]"}},
     "marker_behind_wall",
     "narrows less"},
    {"MarkersOverlap", "cylinder", {{"paths: 24", "paths: 96"}}, "markers_overlap", "at most 71 paths"},
    // The thesis' crop of the image, and a camera in the plane of the skin's end.
    {"MarkersInTheBlindZone",
     "cylinder",
     {{"[0, 0, -26.5]", "[0, 0, -1]"},
      {"first_z_mm: 18", "first_z_mm: 3"},
      {"[640, 480]", "[400, 400]"},
      {"[322.76, 225.23]", "[199.5, 199.5]"}},
     "blind_zone",
     "further out"},
    {"LensTooNarrow",
     "cylinder",
     {{"focal_px: 226.91", "focal_px: 900"},
      {"k1_per_px2: 27.85e-7", "k1_per_px2: 0"},
      {"k2_per_px4: -14.09e-11", "k2_per_px4: 0"}},
     "marker_outside_image",
     "top camera"},
    {"MarkersInTheClamp", "cylinder", {{"first_z_mm: 18", "first_z_mm: 1"}}, "ring_at_clamp", "from the end"},
};

INSTANTIATE_TEST_SUITE_P(Designs, BrokenDesignTest, ::testing::ValuesIn(kBroken),
                         [](const auto& broken) { return broken.param.name; });

TEST(SkinCheck, SaysThatWeightIsNotComputedWithoutADensity) {
  LinkModel model = LoadLinkModel("third").value();
  model.density_kg_m3 = 0;
  const std::vector<Finding> findings = FindingsFor(model);
  EXPECT_TRUE(std::ranges::any_of(findings, [](const Finding& f) { return f.id == "weight_not_computed"; }));
  EXPECT_FALSE(std::ranges::any_of(findings, [](const Finding& f) { return f.id == "sag"; }));
}

TEST(SkinCheck, RefusesOptionsThatMakeNoSense) {
  const LinkModel model = LoadLinkModel("third").value();
  EXPECT_FALSE(AnalyzeSkin(model, {.pressure_mpa = -1e-3}).ok());
  EXPECT_FALSE(AnalyzeSkin(model, {.specific_force_mps2 = Vec3(0, NAN, 0)}).ok());
  EXPECT_FALSE(AnalyzeSkin(model, {.least_force_n = 0}).ok());
}

}  // namespace
}  // namespace taclink
