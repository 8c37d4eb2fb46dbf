#include "sensing/model/model_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace taclink {
namespace {

using ::testing::HasSubstr;

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// The shipped one as a file of version 1, which has no evidence of its material.
std::string Cylinder() {
  const std::string text(ShippedModelText("cylinder")), key = "material: ";
  const size_t begin = text.find(key) + key.size();
  const std::string material = text.substr(begin, text.find("}}", begin) + 2 - begin);
  return Replaced(Replaced(text, material, "{youngs_modulus_mpa: 0.1, poisson_ratio: 0.5}"),
                  "taclink_model: 2", "taclink_model: 1");
}

TEST(ModelFile, ShippedModelsLoad) {
  EXPECT_THAT(ShippedModelNames(),
              ::testing::UnorderedElementsAre("cylinder", "barrel", "third", "triple", "cone", "bottle"));
  for (const std::string_view name : ShippedModelNames()) {
    const auto model = LoadLinkModel(std::string(name));
    EXPECT_TRUE(model.ok()) << model.error().message;
  }
  const auto cylinder = LoadLinkModel("cylinder");
  ASSERT_TRUE(cylinder.ok()) << cylinder.error().message;
  EXPECT_EQ(cylinder->markers.count(), 240);
  EXPECT_TRUE(cylinder->material_evidence.has_value());
  const auto barrel = LoadLinkModel("barrel");
  ASSERT_TRUE(barrel.ok()) << barrel.error().message;
  EXPECT_EQ(barrel->markers.count(), 256);
  EXPECT_NEAR(barrel->markers.rings_z_mm.back(), 241, 1e-9);
}

TEST(ModelFile, NumberingFollowsTheThesis) {
  const auto model = LoadLinkModel("cylinder");
  ASSERT_TRUE(model.ok());
  const int marker = model->MarkerIndex(6, 4);  // node #127 = (7, 5), at 90 degrees and z = 90
  EXPECT_EQ(marker + 1 + model->markers.paths, 127);
  const Vec3 p = model->RestMarker(marker);
  EXPECT_NEAR(p.x(), 0, 1e-9);
  EXPECT_GT(p.y(), 30);
  EXPECT_NEAR(p.z(), 90, 1e-9);
}

TEST(ModelFile, BadInputIsNamedWithFileAndLine) {
  const auto message = [](const std::string& text) {
    const auto model = ParseLinkModel("m.yaml", text);
    return model.ok() ? std::string("accepted") : model.error().message;
  };
  EXPECT_THAT(message(Replaced(Cylinder(), "length_mm: 198", "lenght_mm: 198")),
              HasSubstr("'skin.lenght_mm' is not a known key"));
  EXPECT_THAT(message(Replaced(Cylinder(), "tube: {", "tubes: {}\ntube: {")),
              HasSubstr("'tubes' is not a known key"));
  EXPECT_THAT(message(Replaced(Cylinder(), "thickness_mm: 3.5", "thickness_mm: thick")),
              HasSubstr("m.yaml:7: 'skin.thickness_mm' must be a number, not 'thick'"));
  EXPECT_THAT(message(Replaced(Cylinder(), "poisson_ratio: 0.5", "poisson_ratio: 0.6")),
              HasSubstr("at most 0.5"));
  EXPECT_THAT(message(Replaced(Cylinder(), "youngs_modulus_mpa: 0.1", "youngs_modulus_mpa: .nan")),
              HasSubstr("youngs_modulus_mpa"));
  EXPECT_THAT(message(Replaced(Cylinder(), "radius_mm: 36.5", "radius_mm: 15.2")),
              HasSubstr("inside the tube"));
  EXPECT_THAT(message(Replaced(Cylinder(), "count: 10", "count: 30")), HasSubstr("between the clamped ends"));
  EXPECT_THAT(message("{"), HasSubstr("m.yaml:"));
  EXPECT_THAT(message("[]"), HasSubstr("mapping"));
  EXPECT_THAT(message(""), HasSubstr("mapping"));
}

constexpr Material kRubber = {
    .youngs_modulus_mpa = 0.1234, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};

// The new material stands where the old one did, and nothing else has changed.
void ExpectEdited(const std::string& text, const std::string& old_material) {
  const auto edited = WithMaterial("m.yaml", text, kRubber, {0.0021, "a \"test\" {of: braces}"});
  ASSERT_TRUE(edited.ok()) << edited.error().message;
  const auto model = ParseLinkModel("m.yaml", *edited);
  ASSERT_TRUE(model.ok()) << model.error().message;
  EXPECT_EQ(model->material.youngs_modulus_mpa, 0.1234);
  EXPECT_EQ(model->material.law, MaterialLaw::kNeoHookean);
  ASSERT_TRUE(model->material_evidence.has_value());
  EXPECT_EQ(model->material_evidence->sigma_mpa, 0.0021);
  EXPECT_EQ(model->material_evidence->source, "a \"test\" {of: braces}");
  std::string before = Replaced(text, old_material, "MATERIAL"), after = *edited;
  if (before.find("taclink_model: 1") != std::string::npos)
    before = Replaced(before, "taclink_model: 1", "taclink_model: 2");
  const size_t begin = after.find("{youngs_modulus_mpa: 0.1234");
  ASSERT_NE(begin, std::string::npos) << after;
  after.replace(begin, after.find("}}", begin) + 2 - begin, "MATERIAL");
  EXPECT_EQ(before, after);
  // Again, now that there is evidence.
  const auto again = WithMaterial("m.yaml", *edited, kRubber, {0.0021, "a \"test\" {of: braces}"});
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(*again, *edited);
}

TEST(ModelFile, MaterialIsReplacedAndCommentsStay) {
  ExpectEdited(Cylinder(), "{youngs_modulus_mpa: 0.1, poisson_ratio: 0.5}");
  const std::string block = "youngs_modulus_mpa: 0.1  # Ecoflex\n    poisson_ratio: 0.5";
  ExpectEdited(Replaced(Cylinder(), "{youngs_modulus_mpa: 0.1, poisson_ratio: 0.5}", "\n    " + block),
               block);
  const auto bad = WithMaterial("m.yaml", "{}", kRubber, {0.1, ""});
  ASSERT_FALSE(bad.ok());
  EXPECT_THAT(bad.error().message, HasSubstr("m.yaml"));
}

TEST(ModelFile, MaterialThatCannotBeEditedIsSaid) {
  const auto edited = WithMaterial("m.yaml", Replaced(Cylinder(), "material: {", "material: &m {"), kRubber,
                                   {0.0021, "test"});
  ASSERT_FALSE(edited.ok());
  EXPECT_EQ(edited.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(edited.error().message, HasSubstr("by hand material: {youngs_modulus_mpa: 0.1234"));
}

TEST(ModelFile, EvidenceBelongsToVersion2) {
  const std::string with = Replaced(Cylinder(), "poisson_ratio: 0.5}",
                                    "poisson_ratio: 0.5, evidence: {standard_deviation_mpa: 0.01, from: x}}");
  const auto old = ParseLinkModel("m.yaml", with);
  ASSERT_FALSE(old.ok());
  EXPECT_THAT(old.error().message, HasSubstr("'skin.material.evidence' is not a known key"));
  const auto model = ParseLinkModel("m.yaml", Replaced(with, "taclink_model: 1", "taclink_model: 2"));
  ASSERT_TRUE(model.ok()) << model.error().message;
  EXPECT_EQ(model->material_evidence->sigma_mpa, 0.01);
}

TEST(ModelFile, RelaxationIsReadAndSurvivesANewModulus) {
  const std::string with =
      Replaced(Replaced(Cylinder(), "taclink_model: 1", "taclink_model: 2"), "poisson_ratio: 0.5}",
               "poisson_ratio: 0.5, relaxation: {shares: [0.04, 0.05], times_s: [5, 40]}}");
  const auto model = ParseLinkModel("m.yaml", with);
  ASSERT_TRUE(model.ok()) << model.error().message;
  ASSERT_EQ(model->relaxation.terms.size(), 2u);
  EXPECT_EQ(model->relaxation.terms[1].share, 0.05);
  EXPECT_EQ(model->relaxation.terms[1].time_s, 40);
  EXPECT_TRUE(model->relaxation.share_sigmas.empty());
  Relaxation measured = model->relaxation;
  measured.terms[0].share = 0.06;
  measured.share_sigmas = {0.004, 0.007};
  measured.source = "a hold";
  const auto edited = WithRelaxation("m.yaml", with, measured);
  ASSERT_TRUE(edited.ok()) << edited.error().message;
  const auto again = WithMaterial("m.yaml", *edited, {0.12, 0.5, MaterialLaw::kNeoHookean}, {0.002, "test"});
  ASSERT_TRUE(again.ok()) << again.error().message;
  const auto kept = ParseLinkModel("m.yaml", *again);
  ASSERT_TRUE(kept.ok());
  EXPECT_EQ(kept->material.youngs_modulus_mpa, 0.12);
  ASSERT_EQ(kept->relaxation.terms.size(), 2u);
  EXPECT_EQ(kept->relaxation.terms[0].share, 0.06);
  EXPECT_EQ(kept->relaxation.share_sigmas, (std::vector<double>{0.004, 0.007}));
  EXPECT_EQ(kept->relaxation.source, "a hold");
}

TEST(ModelFile, RelaxationThatCannotBeIsRefused) {
  const auto refusal = [](const std::string& relaxation) {
    const auto model = ParseLinkModel(
        "m.yaml", Replaced(Replaced(Cylinder(), "taclink_model: 1", "taclink_model: 2"),
                           "poisson_ratio: 0.5}", "poisson_ratio: 0.5, relaxation: " + relaxation + "}"));
    return model.ok() ? std::string("accepted") : model.error().message;
  };
  EXPECT_THAT(refusal("{shares: [0.04], times_s: [5, 40]}"), HasSubstr("times_s"));
  EXPECT_THAT(refusal("{shares: [0.04, 0.05], times_s: [40, 5]}"), HasSubstr("must rise"));
  EXPECT_THAT(refusal("{shares: [0.6, 0.5], times_s: [5, 40]}"), HasSubstr("0.9"));
  EXPECT_THAT(refusal("{shares: [-0.1], times_s: [5]}"), HasSubstr("shares"));
  EXPECT_THAT(refusal("{shares: [], times_s: []}"), HasSubstr("at least one"));
}

TEST(ModelFile, UnknownNameListsTheShippedOnes) {
  const auto model = LoadLinkModel("no-such-model");
  ASSERT_FALSE(model.ok());
  EXPECT_EQ(model.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(model.error().message, HasSubstr("cylinder"));
}

TEST(ModelFile, CameraTextReadsBack) {
  auto model = LoadLinkModel("cylinder");
  ASSERT_TRUE(model.ok());
  CameraModel camera = model->nominal_rig[CameraId::kBottom];
  camera.camera_from_link.rotation =
      Mat3(Eigen::AngleAxisd(0.03, Vec3(1, 2, 3).normalized())) * camera.camera_from_link.rotation;
  auto file = YamlFile::Parse("c.yaml", "camera:\n" + CameraText(camera, CameraId::kBottom, "  "));
  ASSERT_TRUE(file.ok());
  const CameraModel read = ReadCamera(file->root().Map("camera"), CameraId::kBottom);
  EXPECT_TRUE(file->Finish().ok());
  EXPECT_NEAR((read.camera_from_link.rotation - camera.camera_from_link.rotation).norm(), 0, 1e-9);
  EXPECT_NEAR(
      (read.camera_from_link.Inverse().translation - camera.camera_from_link.Inverse().translation).norm(), 0,
      1e-6);
  EXPECT_NEAR(read.lens.k2_per_px4 / camera.lens.k2_per_px4, 1, 1e-9);
}

}  // namespace
}  // namespace taclink
