// A covariance by harmonics, against the dense one of the same errors.
#include "sensing/estimation/ring_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "sensing/estimation/load_estimator.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kCameraNoiseMm = 0.07;

// A shipped model, or the cylinder with an odd number of paths, two elements apart.
constexpr const char* kOddPaths = "15 paths";
LinkModel ModelOf(const std::string& name) {
  if (name != kOddPaths) return LoadLinkModel(name).value();
  LinkModel model = LoadLinkModel("cylinder").value();
  model.markers.paths = 15;
  return model;
}

class RingCovarianceTest : public ::testing::TestWithParam<const char*> {
 protected:
  RingCovarianceTest()
      : mechanics_(ModelOf(GetParam())),
        near_(mechanics_),
        model_(mechanics_, near_),
        round_(mechanics_),
        general_(mechanics_) {
    std::srand(3);  // of Eigen's Random
    const UntouchedSkin* found =
        mechanics_.Untouched({.pressure_mpa = 8e-4, .specific_force_mps2 = {1, 2, -3}});
    EXPECT_TRUE(found != nullptr && found->inflated() != nullptr);
    skin_ = *found;
    const KnownLoads at{skin_.inflated()->pressure_mpa, skin_.loads.specific_force_mps2};
    EXPECT_TRUE(round_.At(skin_.inflated(), at));
    EXPECT_TRUE(general_.At(skin_.inflated()->state, at));
    const auto markers = static_cast<size_t>(mechanics_.marker_count());
    observed_.displacement_mm.assign(markers, Vec3::Zero());
    observed_.information.assign(markers,
                                 Mat3(Vec3(1, 1, 0.5).asDiagonal()) / (kCameraNoiseMm * kCameraNoiseMm));
  }
  Eigen::MatrixXf Random(Eigen::Index columns) const {
    return Eigen::MatrixXf::Random(3 * mechanics_.marker_count(), columns);
  }
  // Stacked markers, rotated by some paths.
  Eigen::MatrixXf Rotated(const Eigen::MatrixXf& x, int paths) const {
    const LinkModel& link = mechanics_.model();
    const int all = link.markers.paths;
    const Eigen::Matrix3f by =
        Eigen::AngleAxisf(static_cast<float>(2 * kPi * paths / all), Eigen::Vector3f::UnitZ())
            .toRotationMatrix();
    Eigen::MatrixXf rotated(x.rows(), x.cols());
    for (int m = 0; m < link.markers.count(); ++m) {
      const int to = link.MarkerIndex((link.PathOf(m) + paths) % all, link.RingOf(m));
      rotated.middleRows<3>(3 * to) = by * x.middleRows<3>(3 * m);
    }
    return rotated;
  }

  SkinMechanics mechanics_;
  Neighborhoods near_;
  MarkerCovariance model_;
  Linearization round_, general_;
  UntouchedSkin skin_;
  MarkerObservations observed_;
};

TEST_P(RingCovarianceTest, IsTheDenseOne) {
  ASSERT_TRUE(model_.spectrum() != nullptr);
  model_.SetState(round_, skin_);
  RingCovarianceParts parts = model_.UntouchedParts(round_);
  for (Mat3& local : parts.local) local += kCameraNoiseMm * kCameraNoiseMm * Mat3::Identity();
  const auto ring = RingCovariance::Make(model_.spectrum(), parts);
  ASSERT_TRUE(ring != nullptr);
  Eigen::MatrixXd all_mm2;
  model_.WriteUntouched(general_, all_mm2);
  all_mm2.diagonal().array() += kCameraNoiseMm * kCameraNoiseMm;
  const DenseCovariance dense(all_mm2);
  ASSERT_TRUE(dense.is_factored());
  const Eigen::MatrixXf s = all_mm2.selfadjointView<Eigen::Lower>().toDenseMatrix().cast<float>();
  for (int i = 0; i < mechanics_.marker_count(); i += 7) {
    for (int j = 0; j < mechanics_.marker_count(); ++j) {
      ASSERT_LT((ring->Block(i, j) - dense.Block(i, j)).norm(), 1e-4 * s.diagonal().maxCoeff());
      ASSERT_LT((dense.Block(i, j) - s.block<3, 3>(3 * i, 3 * j)).norm(), 1e-6);
    }
  }
  const Eigen::MatrixXf x = Random(5);
  Eigen::MatrixXf by_ring = x, by_dense = x;
  ring->Whiten(by_ring);
  dense.Whiten(by_dense);
  const Eigen::MatrixXf products = by_dense.transpose() * by_dense;
  EXPECT_LT((by_ring.transpose() * by_ring - products).norm(), 1e-3F * products.norm());
  EXPECT_LT((ring->Times(x.col(0)) - s * x.col(0)).norm(), 1e-4F * (s * x.col(0)).norm());
  EXPECT_LT((ring->WhitenTransposed(by_ring.col(1)) - dense.WhitenTransposed(by_dense.col(1))).norm(),
            1e-3F * dense.WhitenTransposed(by_dense.col(1)).norm());

  const int period = ring->spectrum().period(), groups = ring->spectrum().groups();
  Eigen::MatrixXf sum = by_ring;
  for (int by = 1; by < groups; ++by) {
    Eigen::MatrixXf expected = Rotated(x, by * period), rotated = expected;
    ring->Whiten(expected);
    ring->RotateWhitened(by_ring, by, rotated);
    EXPECT_LT((rotated - expected).norm(), 1e-4F * expected.norm()) << by;
    sum += expected;
  }
  EXPECT_LT((ring->SumOfRotations(by_ring) - sum).norm(), 1e-4F * sum.norm() + 1e-3F);
}

// All columns of loads from those of a few, with errors that are not alike around.
TEST_P(RingCovarianceTest, ColumnsAreThoseOfTheDenseOne) {
  KnownLoadsPrior prior;
  prior.now = ErrorsOf(3e-5, Vec3(0.1, 0.02, 0.3).asDiagonal());
  prior.baseline = ErrorsOf(2e-5, Mat3::Zero());
  prior.baseline_mm = skin_.markers_by_loads * prior.baseline;
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(mechanics_.site_count());
  LoadEstimator by_ring(mechanics_, near_), by_dense(mechanics_, near_);
  // What an obstacle hides, and what is seen worse: more markers than may be seen better.
  observed_.information[30].setZero();
  for (size_t m = 7; m < observed_.information.size(); m += 12) observed_.information[m] /= 20;
  ASSERT_TRUE(by_ring.Prepare(round_, skin_, observed_, prior, none, nullptr));
  ASSERT_TRUE(by_dense.Prepare(general_, skin_, observed_, prior, none, nullptr));
  ASSERT_TRUE(by_ring.untouched()->ring != nullptr);
  ASSERT_TRUE(by_dense.untouched()->ring == nullptr);
  EXPECT_TRUE(by_ring.IsPreparedFor(observed_, prior));
  by_ring.Hide(observed_);
  by_dense.Hide(observed_);
  const Eigen::VectorXd norms = by_dense.FreeNorms();
  EXPECT_LT((by_ring.FreeNorms() - norms).cwiseAbs().maxCoeff(), 2e-3 * norms.maxCoeff());

  Eigen::VectorXf pushed = general_.base_mm().cast<float>();
  LoadCases push;
  push.Begin();
  push.Add(200, 0.5 * general_.ForceAt(Linearization::kInward, 200));
  pushed += general_.Displacements(push);
  for (size_t m = 0; m < observed_.displacement_mm.size(); ++m)
    observed_.displacement_mm[m] = pushed.segment<3>(3 * static_cast<Eigen::Index>(m)).cast<double>();
  LoadEstimate found, expected;
  by_ring.Fit(round_, observed_, nullptr, {}, found);
  by_ring.Conclude(round_, found);
  by_dense.Fit(general_, observed_, nullptr, {}, expected);
  by_dense.Conclude(general_, expected);
  ASSERT_EQ(expected.loads.size(), 1U);
  ASSERT_EQ(found.loads.size(), 1U);
  EXPECT_LT((found.loads[0].force_n - expected.loads[0].force_n).norm(), 2e-3);
  EXPECT_LT((found.loads[0].force_covariance_n2 - expected.loads[0].force_covariance_n2).norm(),
            1e-2 * expected.loads[0].force_covariance_n2.norm());
  EXPECT_NEAR(found.region_chi2_per_dof, expected.region_chi2_per_dof,
              0.02 * expected.region_chi2_per_dof + 1e-3);
  EXPECT_LT((found.beside_mm - expected.beside_mm).norm(), 0.01 * expected.beside_mm.norm());
}

// Half of the markers in the dark: their noise is not averaged with that of the others.
TEST_P(RingCovarianceTest, IsNotOfUnequalNoise) {
  for (size_t m = 0; m < observed_.information.size(); m += 2) observed_.information[m] /= 30;
  LoadEstimator estimator(mechanics_, near_);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(mechanics_.site_count());
  ASSERT_TRUE(estimator.Prepare(round_, skin_, observed_, {}, none, nullptr));
  EXPECT_TRUE(estimator.untouched()->ring == nullptr);
  EXPECT_TRUE(estimator.IsPreparedFor(observed_, {}));
}

// Many hidden markers have noise of another size: a tangent must be good for the frame that it is made of.
TEST_P(RingCovarianceTest, IsGoodForItsOwnFrameIfMarkersAreHidden) {
  LoadEstimator estimator(mechanics_, near_);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(mechanics_.site_count());
  const std::vector<Mat3> seen = observed_.information;
  for (const size_t every : {3, 5}) {
    observed_.information = seen;
    for (size_t m = 0; m < seen.size(); m += every) observed_.information[m].setZero();
    ASSERT_TRUE(estimator.Prepare(round_, skin_, observed_, {}, none, nullptr));
    EXPECT_EQ(estimator.untouched()->ring == nullptr, every == 3);
    EXPECT_TRUE(estimator.IsPreparedFor(observed_, {})) << every;
  }
}

INSTANTIATE_TEST_SUITE_P(Models, RingCovarianceTest,
                         ::testing::Values("cylinder", "barrel", "third", kOddPaths));

}  // namespace
}  // namespace taclink
