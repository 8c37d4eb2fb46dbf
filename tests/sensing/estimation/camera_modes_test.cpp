#include "sensing/estimation/camera_modes.h"

#include <gtest/gtest.h>

#include "sensing/core/similar_skin.h"
#include "sensing/model/model_file.h"
#include "tests/support/moved_cameras.h"

namespace taclink {
namespace {

class CameraModesTest : public ::testing::TestWithParam<const char*> {
 protected:
  // Of markers that both cameras see but for some, which one does.
  Eigen::MatrixXd ModesOf(std::optional<CameraId> alone) const {
    MarkerObservations observed;
    for (int m = 0; m < model_.markers.count(); ++m) {
      Mat3 information = Mat3::Identity();
      if (alone) {
        const Vec3 toward =
            (model_.RestMarker(m) - Projector(model_.nominal_rig[*alone]).center_in_link()).normalized();
        information -= toward * toward.transpose();
      }
      observed.displacement_mm.push_back(Vec3::Zero());
      observed.information.push_back(400 * information);
    }
    Eigen::MatrixXd modes_mm;
    CameraModes(model_).Write(observed, modes_mm);
    return modes_mm;
  }
  static constexpr double kShare = 0.3;  // of a mode's standard deviation
  CameraStep Step(Eigen::Index parameter) const {
    CameraStep step = CameraStep::Zero();
    step[parameter] = kShare * (parameter < 3 ? RadFromDeg(0.07) : 0.14 * LengthUnit(model_));
    return step;
  }
  StereoRig MovedRig(CameraId id, Eigen::Index parameter) const {
    StereoRig moved = model_.nominal_rig;
    moved[id] = Moved(moved[id], Step(parameter));
    return moved;
  }

  const LinkModel model_ = LoadLinkModel(GetParam()).value();
  static constexpr Eigen::Index kOfCamera = 6;
};

INSTANTIATE_TEST_SUITE_P(ShippedModels, CameraModesTest, ::testing::Values("cylinder", "barrel"));

// Both cameras together carry the skin with them, the other way.
TEST_P(CameraModesTest, CamerasThatMoveTogetherMoveAllMarkersAlike) {
  const Eigen::MatrixXd modes_mm = ModesOf({});
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Eigen::VectorXd both_mm = modes_mm.col(3 + axis) + modes_mm.col(kOfCamera + 3 + axis);
    const Vec3 expected_mm = -0.14 * LengthUnit(model_) * Vec3::Unit(axis);
    for (Eigen::Index m = 0; m < both_mm.size() / 3; ++m)
      EXPECT_LT((both_mm.segment<3>(3 * m) - expected_mm).norm(), 0.002) << m;
  }
}

TEST_P(CameraModesTest, OneCameraThatMovesPutsMarkersWhereItsPixelsSay) {
  const Eigen::MatrixXd modes_mm = ModesOf({});
  const Eigen::VectorXd rest_mm = Eigen::VectorXd::Zero(modes_mm.rows());
  for (const CameraId id : kBothCameras) {
    for (Eigen::Index parameter = 0; parameter < kOfCamera; ++parameter) {
      const Eigen::VectorXd seen_mm = SeenByMoved(model_, MovedRig(id, parameter), rest_mm);
      const auto mode_mm = modes_mm.col(kOfCamera * static_cast<Eigen::Index>(Index(id)) + parameter);
      EXPECT_LT((seen_mm - kShare * mode_mm).norm(), 0.03 * seen_mm.norm()) << Name(id) << " " << parameter;
    }
  }
}

// Of the pixels of the camera that sees a marker alone, what the mode makes of it explains all.
TEST_P(CameraModesTest, WhatOneCameraSeesMovesWithThatCameraAlone) {
  for (const CameraId id : kBothCameras) {
    const Eigen::MatrixXd modes_mm = ModesOf(id);
    const auto own = kOfCamera * static_cast<Eigen::Index>(Index(id));
    EXPECT_EQ(modes_mm.middleCols(kOfCamera - own, kOfCamera).norm(), 0) << "the other camera's";
    const Projector nominal(model_.nominal_rig[id]);
    for (Eigen::Index parameter = 0; parameter < kOfCamera; ++parameter) {
      const Projector moved(MovedRig(id, parameter)[id]);
      double off_px2 = 0, shift_px2 = 0;
      for (int m = 0; m < model_.markers.count(); ++m) {
        const Vec3 at = model_.RestMarker(m);
        const Vec2 seen = moved.Project(at).value();
        const Vec3 told = at + kShare * modes_mm.block<3, 1>(3 * m, own + parameter);
        off_px2 += (nominal.Project(told).value() - seen).squaredNorm();
        shift_px2 += (nominal.Project(at).value() - seen).squaredNorm();
      }
      EXPECT_LT(std::sqrt(off_px2), 0.03 * std::sqrt(shift_px2)) << Name(id) << " " << parameter;
    }
  }
}

}  // namespace
}  // namespace taclink
