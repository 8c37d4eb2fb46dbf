#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/skin_shape.h"
#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/dome_looks.h"

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
  /// The two rays of a marker that pass each other by more than so many sigmas are not of one marker.
  double stereo_sigmas = 6;
  /// An observation that is off the estimate by more sigmas, the model's own errors allowed for, is no
  /// marker.
  double outlier_sigmas = 6;
};

/// Whether the two pictures of a moment are of one skin.
struct CameraAgreement {
  int pairs = 0;  ///< markers that both cameras see
  int apart = 0;  ///< of these, whose two lines of sight do not meet
};

/// Observed minus predicted image position of a marker.
struct ImageResidual {
  Vec2 px = Vec2::Zero();
  double sigmas = 0;  ///< by the observation's covariance (Mahalanobis distance)
};
/// By camera and marker. nullopt: it is not seen.
using ImageResiduals = std::array<std::vector<std::optional<ImageResidual>>, kCameraCount>;

/// Both cameras' labeled markers as displacements. Where both cameras see a marker its place is the
/// least-squares point of both images [hartley1997], whatever a model expects; where one does, along its ray
/// it is where the estimate has it. One thread; no allocation after construction. Displacements: from the
/// model's rest, stacked, link frame, mm.
class CameraEvidence {
 public:
  CameraEvidence(const LinkModel& model, const StereoRig& rig, const CameraEvidenceOptions& options);

  /// Takes the markers at rest, where they are displaced by `u` from the model. What their pixels are off the
  /// model's projection is systematic (the lens, a marker's place in the mould), and is subtracted from later
  /// observations, whose variance its noise joins. `keep_unseen`: what `rest` does not show keeps its fixed
  /// residual, changed as those of its ring have, with the doubt of that; and a large one is believed, as the
  /// labels are those of a skin that is followed.
  void SetBaseline(const LabelledMarkers& rest, const Eigen::VectorXd& u, bool keep_unseen = false);

  /// Takes the walls' tilts from displacements `u`: the last estimate. Returns the longest change of a seen
  /// point against its marker's centre, mm; if it is large, the estimate is worth repeating.
  double UpdateLooks(const Eigen::VectorXd& u);

  /// A new frame's observations.
  void Observe(const LabelledMarkers& markers);
  /// What they say of the displacements, those of one camera linearized about `u`.
  void Measure(const Eigen::VectorXd& u, MarkerObservations& observed);
  /// Leaves out observations that contradict an estimate, and takes those of suspect pairs back that agree
  /// with it. `covariances`: of the model's error, by marker. True: something changed; measure again.
  bool Reconsider(const Eigen::VectorXd& u, std::span<const Mat3> covariances);

  /// Residuals of the last observed frame against displacements `u`, rejected markers included. Fixed
  /// residuals are subtracted; markers without a known one are left out.
  void Residuals(const Eigen::VectorXd& u, ImageResiduals& residuals) const;
  /// Of the frame that was observed last, once it was measured.
  CameraAgreement Agreement() const;

  bool Uses(int marker, CameraId id) const { return At(marker, id).in_use(); }
  bool IsDropped(int marker, CameraId id) const {
    const Observation& o = At(marker, id);
    return o.seen && o.dropped;
  }

 private:
  enum class ResidualOf { kRing, kBaselineBefore, kMarker };
  struct InRing;
  struct Observation {
    bool seen = false, dropped = false;
    Vec2 pixel = Vec2::Zero();  // fixed residual subtracted
    Mat2 covariance = Mat2::Zero(), weight = Mat2::Zero();
    ResidualOf residual_of = ResidualOf::kRing;
    Vec2 residual = Vec2::Zero();  // fixed one
    std::optional<Vec2> change;  // of the residual from one baseline to the next, where both show the marker
    Mat2 residual_covariance = Mat2::Zero();
    Vec2 rest_px = Vec2::Zero();
    bool linear = false;  // the rest is of the linearization
    Vec3 at = Vec3::Zero();
    Vec3 seen_offset = Vec3::Zero();  // from the centre to what is seen
    Vec2 projected = Vec2::Zero();
    Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();

    bool in_use() const { return seen && !dropped && linear; }
  };

  const Observation& At(int marker, CameraId id) const {
    return observations_[static_cast<size_t>(marker) * kCameraCount + Index(id)];
  }
  void Linearise(Observation& o, size_t camera, int marker, const Vec3& u) const;
  Mat2 DriftOver(const Vec2& moved_px) const;
  void FillUnknownResiduals();
  void FillRing(int ring, size_t camera, double any_change_px2);
  double Triangulate(int marker, Vec3& place, Mat3& information);  // weighted least squares [hartley1997]
  bool IsAmongSuspects(int marker) const;
  void DropAmongSuspects(MarkerObservations& observed);
  double Misfit(size_t observation, const Vec3& u, const Mat3& covariance);

  const CameraEvidenceOptions options_;
  const int paths_, rings_;
  const std::vector<Projector> projectors_;
  std::vector<Vec3> rest_mm_;  // link frame
  DomeLooks looks_;
  std::vector<Observation> observations_;
  // Suspect pairs are dropped until an estimate without them confirms one (kRaysApart) or both
  // (kAmongSuspects).
  enum class Suspicion : uint8_t { kNone, kRaysApart, kAmongSuspects };
  std::vector<Suspicion> suspicion_;  // by marker
};

}  // namespace taclink
