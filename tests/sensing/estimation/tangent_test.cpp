#include "sensing/estimation/tangent.h"

#include <gtest/gtest.h>

#include <thread>

#include "sensing/estimation/tangent_maker.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kReach = 2.5, kSigmaMm = 0.05;

void InAThread(const std::function<void()>& job) {
  std::thread(job).detach();
}

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
  ASSERT_TRUE(touched.Make(problem_, Dented(1), local, still.loads.untouched()));
  EXPECT_EQ(touched.loads.untouched(), still.loads.untouched());
  for (Tangent* tangent : {&whole, &touched}) tangent->loads.ConcludeUntouched(problem_.observed);
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const Mat3 expected = whole.loads.ModelCovariance(m);
    EXPECT_LT((touched.loads.ModelCovariance(m) - expected).norm(), 0.05 * expected.norm()) << m;
  }
}

TEST_F(TangentTest, TheMakersIsTheSame) {
  Tangent own(mechanics_, near_, kReach);
  ASSERT_TRUE(own.Make(problem_, Dented(1), none_, nullptr));
  for (const BackgroundRunner& background : {BackgroundRunner{}, BackgroundRunner{InAThread}}) {
    TangentMaker maker(std::make_unique<Tangent>(mechanics_, near_, kReach), background);
    EXPECT_FALSE(maker.is_begun());
    for (const double mm : {4.0, 1.0}) {
      maker.Begin(problem_, Dented(mm), none_, nullptr);
      EXPECT_TRUE(maker.is_begun());
      maker.Finish();
      EXPECT_FALSE(maker.is_begun());
    }
    Tangent& made = *maker.spare();
    EXPECT_TRUE(made.IsGoodFor(problem_, Dented(1)));
    EXPECT_EQ(made.DistanceMm(Dented(1)), 0);
    const std::vector<int> sites = {3, 200};
    made.skin.MakeColumns(sites);
    own.skin.MakeColumns(sites);
    for (const auto direction : {Linearization::kInward, Linearization::kAround, Linearization::kAlong}) {
      for (const int site : sites)
        EXPECT_EQ(made.skin.Column(direction, site), own.skin.Column(direction, site)) << site;
    }
  }
}

// A background that is too busy: who needs the tangent makes it, and the job that comes later does nothing,
// even when the maker is gone.
TEST_F(TangentTest, AMakerDoesNotWaitForWhatHasNotBegun) {
  std::vector<std::function<void()>> jobs;
  {
    TangentMaker maker(std::make_unique<Tangent>(mechanics_, near_, kReach),
                       [&](std::function<void()> job) { jobs.push_back(std::move(job)); });
    maker.Begin(problem_, Dented(1), none_, nullptr);
    maker.Finish();
    EXPECT_TRUE(maker.spare()->IsGoodFor(problem_, Dented(1)));
    maker.spare()->Forget();
    ASSERT_EQ(jobs.size(), 1u);
    jobs[0]();
    EXPECT_FALSE(maker.spare()->IsGoodFor(problem_, Dented(1)));
    maker.Begin(problem_, Dented(1), none_, nullptr);
  }
  ASSERT_EQ(jobs.size(), 2u);
  jobs[1]();
}

// Destroyed at work: it ends first.
TEST_F(TangentTest, AMakerEndsAtWork) {
  TangentMaker maker(std::make_unique<Tangent>(mechanics_, near_, kReach), InAThread);
  maker.Begin(problem_, Dented(0), none_, nullptr);
}

}  // namespace
}  // namespace taclink
