#include "sensing/estimation/camera_modes.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "sensing/camera/projection.h"
#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

// A motion three times as large still costs little chi^2 of what markers tell. More modes, or larger ones,
// take up bodies: with the focal lengths' of 0.3 % hands of solids lost a quarter of their force, with 0.15
// degrees and 0.3 mm there were phantoms. A lens that shifts against its sensor is taken for a turn.
constexpr double kTurnDeg = 0.07, kMoveMm = 0.14;
constexpr Eigen::Index kModesOfCamera = 6;  // the first parameters of CameraStep
// Of the sum of a marker's information: makes that of one camera regular, and does nothing to that of two.
constexpr double kUntoldShare = 1e-6;
// Likewise: a direction with less is that camera's line of sight.
constexpr double kNoShare = 1e-4;

CameraStep Sigmas(double unit) {
  CameraStep sigmas = CameraStep::Zero();
  sigmas.segment<3>(0).setConstant(RadFromDeg(kTurnDeg));
  sigmas.segment<3>(3).setConstant(kMoveMm * unit);
  return sigmas;
}

Eigen::LDLT<Mat3> Factor(Mat3 information) {
  information.diagonal().array() += kUntoldShare * information.trace() + 1e-12;
  return information.ldlt();
}

}  // namespace

CameraModes::CameraModes(const LinkModel& model) {
  const std::vector<Vec3> rest_mm = model.RestMarkers();
  const auto rows = 3 * static_cast<Eigen::Index>(rest_mm.size());
  const CameraStep sigmas = Sigmas(LengthUnit(model));
  both_mm_.setZero(rows, kModesOfCamera * kCameraCount);
  for (Eigen::MatrixXd& alone_mm : alone_mm_) alone_mm = both_mm_;
  const std::array<Projector, kCameraCount> cameras{Projector(model.nominal_rig[CameraId::kTop]),
                                                    Projector(model.nominal_rig[CameraId::kBottom])};
  for (size_t m = 0; m < rest_mm.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    Mat3 information = Mat3::Zero();
    Eigen::Matrix<double, 3, kModesOfCamera * kCameraCount> pull =
        Eigen::Matrix<double, 3, kModesOfCamera * kCameraCount>::Zero();
    for (size_t c = 0; c < kCameraCount; ++c) {
      lines_of_sight_[c].push_back((rest_mm[m] - cameras[c].center_in_link()).normalized());
      const auto seen = cameras[c].ProjectWithCameraJacobian(rest_mm[m]);
      if (!seen) continue;
      const Mat3 own = seen->by_point.transpose() * seen->by_point;
      auto mine = pull.middleCols<kModesOfCamera>(kModesOfCamera * static_cast<Eigen::Index>(c));
      mine = seen->by_point.transpose() * (seen->by_camera * sigmas.asDiagonal()).leftCols<kModesOfCamera>();
      alone_mm_[c].block<3, kModesOfCamera>(at, kModesOfCamera * static_cast<Eigen::Index>(c)) =
          Factor(own).solve(mine);
      information += own;
    }
    both_mm_.middleRows<3>(at) = Factor(information).solve(pull);
  }
}

void CameraModes::Write(const MarkerObservations& observed, Eigen::MatrixXd& modes_mm) const {
  modes_mm = both_mm_;
  for (size_t m = 0; m < observed.information.size(); ++m) {
    const Mat3& information = observed.information[m];
    if (!(information.trace() > 0)) continue;
    const Eigen::SelfAdjointEigenSolver<Mat3> axes(information);
    if (axes.eigenvalues()[0] > kNoShare * information.trace()) continue;
    const Vec3 untold = axes.eigenvectors().col(0);
    const double by_top = std::abs(untold.dot(lines_of_sight_[0][m])),
                 by_bottom = std::abs(untold.dot(lines_of_sight_[1][m]));
    const auto at = 3 * static_cast<Eigen::Index>(m);
    modes_mm.middleRows<3>(at) = alone_mm_[by_top > by_bottom ? 0 : 1].middleRows<3>(at);
  }
}

}  // namespace taclink
