#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/baseline.h"
#include "sensing/core/contact.h"
#include "sensing/core/frame.h"
#include "sensing/core/skin_shape.h"
#include "sensing/core/tracking_report.h"

namespace taclink {

enum class LinkStatus : uint8_t {
  kStarting,     ///< no frame yet
  kCalibrating,  ///< waiting for a good rest picture; nothing is measured yet
  kOk,
  kDegraded,  ///< measures, but worse than it could: see the reason
  kLost,      ///< the source or the markers are gone; nothing is measured now
};

/// How long each stage of a frame took, ms; 0: did not run.
struct StageTimes {
  double decode = 0;
  double detect = 0;     ///< the pictures are read: markers followed in their windows, or spots found in all
  double register_ = 0;  ///< labels: checked, or found anew; with a search of the full pictures after a loss
  double reconstruct = 0;
  double force = 0;  ///< forces and contacts
};

struct CameraCounts {
  int detections = 0;  ///< spots in the full picture; while tracked, those of labelled markers
  int labelled = 0;
  bool bad_picture = false;  ///< there was one, but it could not be decoded or has the wrong size
};

/// All that one frame told about one link. Immutable once published.
struct LinkState {
  uint64_t sequence = 0;  ///< of the frame
  FrameTimes times;
  LinkStatus status = LinkStatus::kStarting;
  std::string status_reason;           ///< empty when kOk
  std::optional<double> pressure_mpa;  ///< measured; none: assumed, or the sensor's is stale
  PressureReport pressure;

  std::array<CameraCounts, kCameraCount> cameras;
  TrackingReport tracking;
  SkinShape shape;     ///< empty while nothing is measured
  NodalForces forces;  ///< empty while nothing is measured
  std::vector<Contact> contacts;
  Vec3 total_force_n = Vec3::Zero();  ///< sum over the contacts
  double baseline_age_s = 0;          ///< from when the baseline was taken to the exposure
  Baseline baseline;
  StageTimes stage_ms;
  bool replayed = false;  ///< from a log: the UTC times are those of then

  bool measured() const { return !shape.positions_mm.empty(); }
  /// Nothing is measured; most buffers stay.
  void ClearMeasurement() {
    shape.positions_mm.clear();
    shape.displacements_mm.clear();
    shape.covariances_mm2.clear();
    shape.sources.clear();
    shape.measured.clear();
    shape.rejected.clear();
    forces.forces_n.clear();
    forces.sigmas_n.clear();
    forces.loaded.clear();
    forces.loaded_covariance.resize(0, 0);
    forces.residual = 0;
    forces.converged = true;
    contacts.clear();
    total_force_n.setZero();
  }
};

}  // namespace taclink
