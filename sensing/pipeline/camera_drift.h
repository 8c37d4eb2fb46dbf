#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/known_loads.h"
#include "sensing/core/markers.h"
#include "sensing/estimation/camera_evidence.h"
#include "sensing/estimation/skin_mechanics.h"
#include "sensing/pipeline/touch_selection.h"

namespace taclink {

/// By how much each camera's image has grown since the baseline, whatever touches the skin and however far it
/// is inflated: focus that creeps, a lens that warms. What the estimated equilibrium leaves of the markers'
/// motion in both images is fitted, to first order about the untouched skin, by six degrees of freedom and
/// the scale of each camera, errors of the known loads, and normal forces at up to three markers
/// (SelectTouches). The estimator's own camera modes have no scale, since with it they take up bodies; here
/// it is measured and not applied. All matrices are constant: a frame costs some hundredths of a millisecond
/// and allocates nothing. One thread.
class CameraDrift {
 public:
  /// Of the rest images: their known loads, under which the skin is stable, cameras and labels.
  CameraDrift(SkinMechanics& mechanics, const MeasuredLoads& loads, const StereoRig& rig,
              const LabelledMarkers& rest);

  /// The mean radial part of an image's motion by its camera's turn, move and scale; a move along the link
  /// counts.
  struct Growth {
    double share = 0;  ///< of the image; 0.01: 1 % larger
    double sigma = 0;
  };
  /// nullopt: a camera sees too few of its markers, or first order does not explain the residuals.
  std::optional<std::array<Growth, kCameraCount>> Measure(const ImageResiduals& residuals);

 private:
  static constexpr Eigen::Index kModesOfCamera = 7;  // turn, move, scale
  static constexpr Eigen::Index kModes = kModesOfCamera * kCameraCount + KnownLoads::kCount;
  using Modes = Eigen::Matrix<double, kModes, 1>;

  void SetRows(SkinMechanics& mechanics, const KnownLoads& loads, const StereoRig& rig,
               const LabelledMarkers& rest);
  void Eliminate(const SkinMechanics& mechanics, const MeasuredLoads& loads);

  struct Row {  // a marker in one image; two numbers
    int marker = 0;
    CameraId camera = CameraId::kTop;
  };

  // Constant after construction; residuals in standard deviations.
  std::vector<Row> rows_;
  std::array<int, kCameraCount> rows_of_camera_ = {};
  Eigen::Matrix<double, Eigen::Dynamic, kModes> modes_;
  Eigen::MatrixXd touches_;
  Eigen::LDLT<Eigen::Matrix<double, kModes, kModes>> information_;  // modes' modes and their prior
  Eigen::Matrix<double, kModes, Eigen::Dynamic> modes_by_touches_;
  std::array<Modes, kCameraCount> growth_by_modes_;

  // Scratch.
  Eigen::VectorXd y_;
  TouchEquations reduced_;  // its normal matrix is constant
};

}  // namespace taclink
