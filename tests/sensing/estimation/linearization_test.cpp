#include "sensing/estimation/linearization.h"

#include <gtest/gtest.h>

#include <numeric>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class LinearizationTest : public ::testing::TestWithParam<const char*> {
 protected:
  LinearizationTest() : mechanics_(LoadLinkModel(GetParam()).value()), all_(sites()) {
    std::iota(all_.begin(), all_.end(), 0);
  }
  size_t sites() const { return static_cast<size_t>(mechanics_.site_count()); }

  SkinMechanics mechanics_;
  std::vector<int> all_;
};

// From the sites' side they are what they are from the markers' side.
TEST_P(LinearizationTest, ColumnsOfSomeSitesAreThoseOfAll) {
  Linearization whole(mechanics_), part(mechanics_);
  const UntouchedSkin* inflated = mechanics_.Untouched({.pressure_mpa = 5e-4});
  ASSERT_TRUE(inflated != nullptr);
  ASSERT_TRUE(whole.At(inflated->state, inflated->loads));
  ASSERT_TRUE(part.At(inflated->state, inflated->loads));
  whole.MakeColumns(all_);
  const int last = mechanics_.site_count() - 1;
  part.MakeColumns(std::vector{last, 7, 130});
  part.MakeColumns(std::vector{7, 0});
  for (const int site : {0, 7, 130, last}) {
    for (const auto direction : {Linearization::kInward, Linearization::kAround, Linearization::kAlong}) {
      const Eigen::VectorXf expected = whole.Column(direction, site);
      EXPECT_LT((part.Column(direction, site) - expected).norm(), 1e-3F * expected.norm())
          << site << " " << direction;
    }
  }
}

// With the stiffness by harmonics and turned columns it is what it is with the block factor.
TEST_P(LinearizationTest, AnInflatedSkinsIsThatOfItsState) {
  Linearization general(mechanics_), round(mechanics_);
  const UntouchedSkin* skin = mechanics_.Untouched({.pressure_mpa = 1e-3, .specific_force_mps2 = {3, -4, 5}});
  ASSERT_TRUE(skin != nullptr && skin->inflated != nullptr);
  ASSERT_GT((skin->state.mids_mm[300] - skin->inflated->state.mids_mm[300]).norm(), 0.2) << "it sags";
  const KnownLoads at{skin->inflated->pressure_mpa, {1, -2, 0.5}};
  ASSERT_TRUE(general.At(skin->inflated->state, at));
  ASSERT_TRUE(round.At(skin->inflated, at));
  EXPECT_LT((round.base_mm() - general.base_mm()).norm(), 1e-5 * general.base_mm().norm());
  EXPECT_LT((round.by_known_loads() - general.by_known_loads()).norm(),
            1e-5 * general.by_known_loads().norm());
  general.MakeColumns(all_);
  round.MakeColumns(std::vector{130, 7});
  round.MakeColumns(all_);
  const int last = mechanics_.site_count() - 1;
  for (const int site : {0, 7, 130, last}) {
    for (const auto direction : {Linearization::kInward, Linearization::kAround, Linearization::kAlong}) {
      const Eigen::VectorXf expected = general.Column(direction, site);
      EXPECT_LT((round.Column(direction, site) - expected).norm(), 1e-4F * expected.norm())
          << site << " " << direction;
    }
  }
  const Eigen::MatrixXf rings = general.RingColumns();
  EXPECT_LT((round.RingColumns() - rings).norm(), 1e-4F * rings.norm());
  // And from the state that sags.
  ASSERT_TRUE(round.Rebase(skin->state, skin->loads));
  EXPECT_LT((round.base_mm() - skin->markers_mm).norm(), 1e-3 * skin->markers_mm.norm());
}

TEST_P(LinearizationTest, ARingsColumnIsTheMeanOfItsSites) {
  Linearization skin(mechanics_);
  const UntouchedSkin* inflated = mechanics_.Untouched({.pressure_mpa = 5e-4});
  ASSERT_TRUE(inflated != nullptr);
  ASSERT_TRUE(skin.At(inflated->state, inflated->loads));
  skin.MakeColumns(all_);
  const Eigen::MatrixXf rings = skin.RingColumns();
  ASSERT_EQ(rings.cols(), mechanics_.site_rows());
  const int around = mechanics_.columns();
  for (const int ring : {0, mechanics_.site_rows() / 2}) {
    Eigen::VectorXd shares = Eigen::VectorXd::Zero(mechanics_.site_count());
    shares.segment(ring * around, around).setConstant(1.0 / around);
    const Eigen::VectorXd spread = mechanics_.spread() * shares;
    Eigen::VectorXf expected = Eigen::VectorXf::Zero(rings.rows());
    for (const int site : all_)
      expected += static_cast<float>(spread[site]) * skin.Column(Linearization::kInward, site);
    EXPECT_LT((rings.col(ring) - expected).norm(), 1e-3F * expected.norm()) << ring;
  }
}

INSTANTIATE_TEST_SUITE_P(Skins, LinearizationTest, ::testing::Values("cylinder", "barrel", "third"));

}  // namespace
}  // namespace taclink
