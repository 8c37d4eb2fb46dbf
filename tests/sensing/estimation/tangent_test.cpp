#include "sensing/estimation/tangent.h"

#include <gtest/gtest.h>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kReach = 2.5, kSigmaMm = 0.05;

class TangentTest : public ::testing::Test {
 protected:
  TangentTest() {
    problem_.untouched = *mechanics_.Untouched({});
    problem_.prior.now = ErrorsOf(3e-5, Mat3::Zero());
    problem_.observed.displacement_mm.assign(kMarkers, Vec3::Zero());
    problem_.observed.information.assign(kMarkers, Mat3::Identity() / (kSigmaMm * kSigmaMm));
  }
  ShellState Dented(double mm) const {
    ShellState state = problem_.untouched.state;
    state.mids_mm[state.mids_mm.size() / 2].z() += mm;
    return state;
  }

  static constexpr size_t kMarkers = 240;
  SkinMechanics mechanics_{LoadLinkModel("cylinder").value()};
  const Neighborhoods near_{mechanics_};
  SkinProblem problem_;
  const Eigen::VectorXd none_ = Eigen::VectorXd::Zero(mechanics_.site_count());
};

TEST_F(TangentTest, IsGoodNearWhereItWasMade) {
  Tangent tangent(mechanics_, near_, kReach);
  EXPECT_FALSE(tangent.IsGoodFor(problem_, Dented(0)));
  ASSERT_TRUE(tangent.Make(problem_, Dented(0), none_, nullptr));
  EXPECT_TRUE(tangent.IsGoodFor(problem_, Dented(2.4)));
  EXPECT_FALSE(tangent.IsGoodFor(problem_, Dented(2.6)));
  EXPECT_NEAR(tangent.DistanceMm(Dented(2)), 2, 1e-9);
  SkinProblem sharper = problem_;
  for (Mat3& information : sharper.observed.information) information *= 9;
  EXPECT_FALSE(tangent.IsGoodFor(sharper, Dented(0)));
  tangent.Forget();
  EXPECT_FALSE(tangent.IsGoodFor(problem_, Dented(0)));
}

TEST_F(TangentTest, IsGoodForForcesOfItsSize) {
  Tangent tangent(mechanics_, near_, kReach);
  EXPECT_FALSE(tangent.HasLocal(none_));
  Eigen::VectorXd local = none_;
  local[300] = 1;
  ASSERT_TRUE(tangent.Make(problem_, Dented(0), local, nullptr));
  EXPECT_TRUE(tangent.HasLocal(1.5 * local));
  EXPECT_FALSE(tangent.HasLocal(1.5 * local, 0.5));
  EXPECT_FALSE(tangent.HasLocal(3 * local));
  EXPECT_FALSE(tangent.HasLocal(none_));
}

// It takes from the untouched skin what stray forces do where nothing presses.
TEST_F(TangentTest, OfATouchedSkinWeighsAsIfItHadMadeAll) {
  Tangent still(mechanics_, near_, kReach), touched(mechanics_, near_, kReach),
      whole(mechanics_, near_, kReach);
  ASSERT_TRUE(still.Make(problem_, problem_.untouched.state, none_, nullptr));
  Eigen::VectorXd local = none_;
  local[300] = 0.5;
  ASSERT_TRUE(whole.Make(problem_, Dented(1), local, nullptr));
  ASSERT_TRUE(touched.Make(problem_, Dented(1), local, &still));
  EXPECT_EQ(touched.loads.untouched(), still.loads.untouched());
  for (Tangent* tangent : {&whole, &touched}) tangent->loads.ConcludeUntouched(problem_.observed);
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const Mat3 expected = whole.loads.ModelCovariance(m);
    EXPECT_LT((touched.loads.ModelCovariance(m) - expected).norm(), 0.05 * expected.norm()) << m;
  }
}

}  // namespace
}  // namespace taclink
