#include "sensing/estimation/camera_evidence.h"

#include <gtest/gtest.h>

#include "sensing/camera/projection.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

/// A skin that has crept between two baselines, which a tare takes for untouched; some markers are seen now
/// and then only.
class CameraEvidenceTest : public ::testing::Test {
 protected:
  static constexpr int kHidden = 100;  // from the top camera, whenever a baseline is taken again

  static CameraEvidenceOptions Points() {
    CameraEvidenceOptions options;
    options.domes = false;
    return options;
  }
  Vec3 Outward(int marker) const {
    const Vec3 rest = model_.RestMarker(marker);
    return Vec3(rest.x(), rest.y(), 0).normalized();
  }
  LabelledMarkers See(double outward_mm, const std::vector<int>& hidden_from_top = {}) const {
    LabelledMarkers seen;
    for (const CameraId id : kBothCameras) {
      const Projector projector(model_.nominal_rig[id]);
      auto& markers = seen.cameras[Index(id)];
      markers.resize(static_cast<size_t>(model_.markers.count()));
      for (int m = 0; m < model_.markers.count(); ++m) {
        const auto pixel = projector.Project(model_.RestMarker(m) + outward_mm * Outward(m));
        if (!pixel) continue;
        markers[static_cast<size_t>(m)] = {
            .seen = true, .center_px = *pixel, .covariance_px2 = 1e-4 * Mat2::Identity()};
      }
    }
    for (const int m : hidden_from_top)
      seen.cameras[Index(CameraId::kTop)][static_cast<size_t>(m)].seen = false;
    return seen;
  }
  std::vector<int> Ring() const {
    std::vector<int> ring;
    for (int path = 0; path < model_.markers.paths; ++path)
      ring.push_back(model_.MarkerIndex(path, model_.RingOf(kHidden)));
    return ring;
  }
  /// chi^2 of the hidden marker on a skin that is as it was tared.
  double Chi2AfterTare(double crept_mm, const std::vector<int>& hidden) {
    CameraEvidence evidence(model_, model_.nominal_rig, Points());
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(3 * model_.markers.count());
    evidence.SetBaseline(See(0), none);
    evidence.SetBaseline(See(crept_mm, hidden), none, true);
    evidence.Observe(See(crept_mm));
    evidence.Measure(none, observed_);
    const Vec3& off = observed_.displacement_mm[kHidden];
    return off.dot(observed_.information[kHidden] * off);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  MarkerObservations observed_;
};

TEST_F(CameraEvidenceTest, WhatATareDoesNotSeeHasMovedAsItsRingHas) {
  EXPECT_LT(Chi2AfterTare(0.3, {}), 1e-6);
  EXPECT_LT(Chi2AfterTare(0.3, {kHidden}), 0.1);
}

TEST_F(CameraEvidenceTest, WhereNothingOfARingIsSeenItsCreepIsInTheDoubt) {
  EXPECT_LT(Chi2AfterTare(0.3, Ring()), 9);
  const double doubtful = observed_.information[kHidden].trace();
  EXPECT_LT(Chi2AfterTare(0, Ring()), 1e-6);
  EXPECT_LT(doubtful, 0.5 * observed_.information[kHidden].trace()) << "a skin that has not crept has none";
}

// Cameras are on the axis: epipolar lines are radial in their images.
TEST_F(CameraEvidenceTest, WhatIsDisplacedAlongTheEpipolarLineAmongRaysThatMissIsDropped) {
  const int path = 8, ring = 4, marker = model_.MarkerIndex(path, ring);
  const Vec2 middle = model_.nominal_rig[CameraId::kTop].lens.principal_point_px;
  const auto displace = [&](LabelledMarkers& seen, int which, double outward_px, double sideways_px) {
    Vec2& pixel = seen.cameras[Index(CameraId::kTop)][static_cast<size_t>(which)].center_px;
    const Vec2 outward = (pixel - middle).normalized();
    pixel += outward_px * outward + sideways_px * Vec2(-outward.y(), outward.x());
  };
  for (const bool is_displaced : {true, false}) {
    LabelledMarkers seen = See(0);
    for (const int beside : {model_.MarkerIndex(path - 1, ring), model_.MarkerIndex(path + 1, ring),
                             model_.MarkerIndex(path, ring + 1)})
      displace(seen, beside, 0, 3);
    if (is_displaced) displace(seen, marker, 3, 0);
    CameraEvidence evidence(model_, model_.nominal_rig, Points());
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(3 * model_.markers.count());
    evidence.SetBaseline(See(0), none);
    evidence.Observe(seen);
    evidence.Measure(none, observed_);
    EXPECT_EQ(evidence.Agreement().apart, 3);
    for (const CameraId id : kBothCameras) EXPECT_TRUE(evidence.IsDropped(marker, id));
    EXPECT_TRUE(observed_.information[static_cast<size_t>(marker)].isZero());
    const std::vector<Mat3> covariances(observed_.information.size(), 1e-4 * Mat3::Identity());
    EXPECT_TRUE(evidence.Reconsider(none, covariances));
    EXPECT_EQ(evidence.IsDropped(marker, CameraId::kTop), is_displaced);
    EXPECT_FALSE(evidence.IsDropped(marker, CameraId::kBottom));
  }
}

}  // namespace
}  // namespace taclink
