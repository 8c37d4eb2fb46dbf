#pragma once

#include <array>
#include <span>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/shape/dome_looks.h"
#include "sensing/shape/evidence.h"
#include "sensing/shape/skin_basis.h"

namespace taclink {

struct CameraEvidenceOptions {
  /// Markers are half balls that show another side to a camera as the wall tilts; false: points.
  bool domes = true;
  /// Error of the calibrated cameras themselves, px; added to each detection's.
  double camera_sigma_px = 0.1;
  /// Error of the places at rest beyond the covariances that come with them, px.
  double rest_sigma_px = 0;
  /// How a marker's fixed residual (see SetBaseline) changes as it moves, px per px.
  double residual_drift = 0.01;
  /// Fixed residual where the rest pictures do not tell it, px; more than the second at rest is no marker.
  double unknown_residual_px = 1;
  double max_residual_px = 8;
  /// An estimate that moved further than this from where the projection was linearised is linearised again.
  double linear_within_mm = 0.25;
  /// A dropped observation comes back when it is this near to what is predicted without it, sigmas.
  double readmit_sigmas = 3.5;
};

/// Both cameras' labelled markers as evidence. An observation's index is marker * 2 + camera. One thread; no
/// allocation after construction.
class CameraEvidence : public Evidence {
 public:
  CameraEvidence(const LinkModel& model, const StereoRig& rig, const SkinBasis& basis,
                 const CameraEvidenceOptions& options);

  /// Takes the markers at rest, where they are displaced by `u` from the model. What their pixels are off the
  /// model's projection is systematic (the lens, a marker's place in the mould), and is subtracted from later
  /// observations, whose variance its noise joins. `keep_unseen`: what `rest` does not show keeps its fixed
  /// residual, and a large one is believed, as the labels are those of a skin that is followed.
  void SetBaseline(const LabelledMarkers& rest, const Eigen::VectorXd& u, bool keep_unseen = false);

  /// Takes the walls' tilts from displacements `u`: the last estimate. Returns the longest change of a seen
  /// point against its marker's centre, mm; if it is large, the estimate is worth repeating.
  double UpdateLooks(const Eigen::VectorXd& u);

  /// A new frame's observations. What was dropped stays so, until Readmit or the marker is not seen.
  void Observe(const LabelledMarkers& markers);

  void Evaluate(const Eigen::VectorXd& u, const Eigen::VectorXd& slack,
                std::vector<MarkerEvidence>& markers) override;
  Misfit Worst() const override { return worst_; }
  void Drop(int observation) override;
  bool Readmit(const Eigen::VectorXd& u, std::span<const Mat3> covariances) override;
  int dropped() const override { return dropped_; }

  bool Uses(int marker, CameraId id) const {
    const Observation& o = observations_[static_cast<size_t>(marker) * kCameraCount + Index(id)];
    return o.seen && !o.dropped && o.linear;
  }
  bool IsDropped(int marker, CameraId id) const {
    const Observation& o = observations_[static_cast<size_t>(marker) * kCameraCount + Index(id)];
    return o.seen && o.dropped;
  }
  /// Without slack, at the last Evaluate; by marker, own frames.
  std::span<const MarkerEvidence> exact() const { return exact_; }

 private:
  struct Observation {
    bool seen = false, dropped = false;
    Vec2 pixel = Vec2::Zero();  // fixed residual subtracted
    Mat2 covariance = Mat2::Zero(), weight = Mat2::Zero();
    bool has_baseline = false;
    Vec2 residual = Vec2::Zero();  // fixed one
    Mat2 residual_covariance = Mat2::Zero();
    Vec2 rest_px = Vec2::Zero();
    bool linear = false;  // the rest is of the linearisation
    Vec3 at = Vec3::Zero();
    Vec3 seen_offset = Vec3::Zero();  // from the centre to what is seen
    Vec2 projected = Vec2::Zero();
    Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();
  };

  void Linearise(Observation& o, size_t camera, int marker, const Vec3& u) const;
  void FillUnknownResiduals();

  const CameraEvidenceOptions options_;
  const SkinBasis& basis_;
  const std::vector<Projector> projectors_;
  std::vector<Vec3> rest_mm_;  // link frame
  DomeLooks looks_;
  std::vector<Observation> observations_;
  std::vector<MarkerEvidence> exact_;
  Misfit worst_;
  int dropped_ = 0;
};

}  // namespace taclink
