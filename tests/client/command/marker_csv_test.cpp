#include "client/command/offline/marker_csv.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>

#include "client/command/offline/marker_noise.h"
#include "sensing/model/model_file.h"
#include "tests/end_to_end/support.h"

namespace taclink::command {
namespace {

// Displacements of a dent 20 mm wide and of a skin that is blown up by 2 mm, with noise of these deviations.
SkinShape Dented(const LinkModel& model, double xy_mm, double z_mm, double seen_share = 1,
                 unsigned seed = 3) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  SkinShape shape;
  for (int m = 0; m < model.markers.count(); ++m) {
    const double angle = model.PathAngle(model.PathOf(m)), z = model.RestMarker(m).z();
    const double off = std::hypot(36 * std::remainder(angle - 1.3, 2 * kPi), z - 90);
    const double out_mm = 2 - 8 * std::exp(-off * off / (2 * 12 * 12));
    // In braces, numbers are drawn from left to right with every compiler.
    const Vec3 noise{xy_mm * normal(random), xy_mm * normal(random), z_mm * normal(random)};
    shape.displacements_mm.push_back(Vec3(out_mm * std::cos(angle), out_mm * std::sin(angle), 0) + noise);
    shape.sources.push_back(uniform(random) < seen_share ? MarkerSource::kBoth : MarkerSource::kInferred);
  }
  return shape;
}

// Fewer whole windows of seven neighbors scatter more: by a fifth where a fifth of the markers is missing.
TEST(MarkerNoiseTest, IsToldByTheMarkers) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  constexpr unsigned kSeeds = 40;
  for (const double share : {1.0, 0.8}) {
    for (const double mm : {0.08, 0.2, 0.5}) {
      double xy_ratio = 0, z_ratio = 0;
      for (unsigned seed = 0; seed < kSeeds; ++seed) {
        const MarkerNoise noise = NoiseOf(model, Dented(model, mm, 2 * mm, share, seed));
        xy_ratio += noise.xy_mm / mm / kSeeds;
        z_ratio += noise.z_mm / (2 * mm) / kSeeds;
        if (share < 1) continue;
        EXPECT_NEAR(noise.xy_mm, mm, 0.4 * mm) << seed;
        EXPECT_NEAR(noise.z_mm, 2 * mm, 0.8 * mm) << seed;
      }
      EXPECT_NEAR(xy_ratio, 1, 0.15) << share << ", " << mm << " mm";
      EXPECT_NEAR(z_ratio, 1, 0.2) << share << ", " << mm << " mm";
    }
  }
}

TEST(MarkerNoiseTest, IsNotLessThanWhatIsUsualNorTakenFromADent) {
  const MarkerNoise usual;
  const LinkModel cylinder = LoadLinkModel("cylinder").value(), barrel = LoadLinkModel("barrel").value();
  for (const SkinShape& shape : {Dented(cylinder, 0, 0), Dented(cylinder, 1, 1, 0.2)}) {
    EXPECT_EQ(NoiseOf(cylinder, shape).xy_mm, usual.xy_mm);
    EXPECT_EQ(NoiseOf(cylinder, shape).z_mm, usual.z_mm);
  }
  // Its markers are too far apart.
  EXPECT_EQ(NoiseOf(barrel, Dented(barrel, 1, 1)).xy_mm, usual.xy_mm);
}

class MarkerCsvTest : public testing::ScratchFolder {};

TEST_F(MarkerCsvTest, ADeviationThatIsGivenIsUsed) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const std::string file =
      Write("markers.csv", "path,ring,ux,uy,uz\n1,1,0.1,0,0\n2,1,0,0.1,0\n3,1,0,0,0.1\n4,1,,,\n");
  const auto shape = ReadMarkerCsv(file, model, 0.2);
  ASSERT_TRUE(shape.ok()) << shape.error().message;
  EXPECT_EQ(shape->seen(), 3);
  EXPECT_NEAR(shape->covariances_mm2[1](0, 0), 0.04, 1e-12);
  EXPECT_NEAR(shape->covariances_mm2[1](2, 2), 0.36, 1e-12);
  EXPECT_TRUE(shape->measured[3].information_per_mm2.isZero());
  const auto usual = ReadMarkerCsv(file, model, std::nullopt);
  ASSERT_TRUE(usual.ok());
  EXPECT_NEAR(usual->covariances_mm2[1](0, 0), MarkerNoise{}.xy_mm * MarkerNoise{}.xy_mm, 1e-12);
}

TEST_F(MarkerCsvTest, AByteOrderMarkIsNoPartOfTheHeader) {
  const std::string file =
      Write("marked.csv", "\xEF\xBB\xBFpath,ring,ux,uy,uz\n1,1,0.1,0,0\n2,1,0,0,0\n3,1,0,0,0\n");
  const auto shape = ReadMarkerCsv(file, LoadLinkModel("cylinder").value(), 0.1);
  ASSERT_TRUE(shape.ok()) << shape.error().message;
  EXPECT_EQ(shape->seen(), 3);
}

}  // namespace
}  // namespace taclink::command
