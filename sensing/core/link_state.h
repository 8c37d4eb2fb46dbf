#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
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

/// Why a state is worse than it could be. The names (Name) are stable.
enum class ReasonId : uint8_t {
  kFewMarkers,         ///< too few markers are seen
  kCamera,             ///< a camera gives no picture, or none that can be read
  kFrozen,             ///< a camera gives the same picture again and again
  kLate,               ///< a camera shows the skin's motion later than the other
  kCamerasDisagree,    ///< the two pictures are not of one skin at one moment
  kNotConverged,       ///< no loads and pressure were found that explain the markers
  kImpossible,         ///< what was found is not physically possible
  kNoEquilibrium,      ///< no skin of this model is stable under the pressure
  kPressureUnknown,    ///< nobody tells the pressure; the skin's shape does
  kPressureMismatch,   ///< the pressure that is told does not fit the skin's shape
  kResidual,           ///< a region of markers contradicts the estimate
  kLabels,             ///< markers of one region were left out as contradicting
  kTooDeep,            ///< pressed in deeper than forces were compared with the truth
  kBeyondMarkers,      ///< a load that may lie between a clamp and the ring beside it, where it hardly shows
  kEncircled,          ///< bodies all around bend the skin in waves that are hardly resolved
  kSparseMarkers,      ///< a load on this skin may hide between the markers that are in sight
  kUnsettled,          ///< where no camera sees the skin its shape did not settle
  kForceModel,         ///< the force model that was asked for does not hold here
  kCamerasMoved,       ///< or an image has grown: calibrate; what motion alone explains is taken off
  kDrift,              ///< the baseline has drifted
  kNoFrames,           ///< none come from the source, or from the log that is replayed
  kWorker,             ///< what reads or computes the frames is late, has failed or is being started again
  kForcedBaseline,     ///< beside another reason: a baseline that was taken by force may explain it
  kAttitudeUnknown,    ///< the specific force is not known well enough for accurate forces
  kAttitudeMismatch,   ///< the measured specific force does not fit the skin's shape
  kCamerasSwapped,     ///< the top camera's images are those of the bottom camera, and the other way round
  kFrameRate,          ///< a camera gives fewer new images than the link gives frames
  kImageContrast,      ///< markers stand out less in a camera's images than when the rest shape was taken
  kLateFrame,          ///< too much time passed from the exposure to the publication
  kTemporalSmoothing,  ///< a camera blends each image with those before it
  kStiffnessMismatch,  ///< the skin widens under pressure as with another Young's modulus
};
inline constexpr int kReasonCount = static_cast<int>(ReasonId::kStiffnessMismatch) + 1;

/// What a reason's number is in. kNone: a number of markers, or a ratio.
enum class ReasonUnit : uint8_t { kNone, kMillimeters, kMegapascals, kSeconds, kHertz };

/// What is known of a reason whatever the frame.
struct ReasonTraits {
  const char* name = "unknown";
  ReasonUnit unit = ReasonUnit::kNone;
  /// Contacts of a frame with this reason may be invented or missing. False: they are there, and what is in
  /// doubt is only how large or accurate their forces are.
  bool doubts_contacts = true;
  /// Cameras that are turned, exchanged, moved or altered look like this.
  bool may_come_of_cameras = false;
  /// A load that was there when the baseline was taken, and has gone, looks like this: the skin bulges.
  bool may_come_of_baseline = false;
};
const ReasonTraits& TraitsOf(ReasonId id);
inline const char* Name(ReasonId id) {
  return TraitsOf(id).name;
}
/// None: another version's.
std::optional<ReasonId> ReasonNamed(std::string_view name);

struct Reason {
  ReasonId id = ReasonId::kFewMarkers;
  std::string text;  ///< for people, with what to do
  /// What was found, and where it begins to be told. None: it is no matter of more or less.
  std::optional<double> value = {}, limit = {};
};

/// A pressure that the estimate found.
struct PressureEstimate {
  double mpa = 0, sigma_mpa = 0;
};

/// A specific force that the estimate found: gravity less the link's acceleration, link frame.
struct SpecificForceEstimate {
  Vec3 mps2 = Vec3::Zero();
  Mat3 covariance = Mat3::Zero();  ///< (m/s^2)^2
};

/// How long each stage of a frame took, ms; 0: did not run.
struct StageTimes {
  double decode = 0;
  double detect = 0;     ///< the pictures are read: markers followed in their windows, or spots found in all
  double register_ = 0;  ///< labels: checked, or found again; with a search of the full pictures after a loss
  double reconstruct = 0;
  double force = 0;  ///< forces and contacts
};

struct CameraCounts {
  int detections = 0;  ///< spots in the full picture; while tracked, those of labelled markers
  int labelled = 0;
  bool bad_picture = false;  ///< there was one, but it could not be decoded or has the wrong size
  /// How much markers stand out from the skin, by how much they did when the rest shape was taken: 1 is as
  /// then; median of the labelled ones. None: not known.
  std::optional<double> contrast = {};
};

/// All that one frame told about one link. Immutable once published.
struct LinkState {
  uint64_t sequence = 0;  ///< of the frame
  FrameTimes times;
  LinkStatus status = LinkStatus::kStarting;
  std::string status_reason;           ///< empty when kOk; of the first reason
  std::vector<Reason> reasons;         ///< all that make it worse, the gravest first; of measured frames
  std::optional<double> pressure_mpa;  ///< measured; none: assumed, or the sensor's is stale
  PressureReport pressure;
  std::optional<PressureEstimate> pressure_estimate;   ///< what the skin's shape and the sensor say together
  std::optional<SpecificForceReading> specific_force;  ///< measured; none: the link never moves
  /// What the skin's shape and that say together; none: it counts as exact.
  std::optional<SpecificForceEstimate> specific_force_estimate;

  std::array<CameraCounts, kCameraCount> cameras;
  TrackingReport tracking;
  SkinShape shape;     ///< empty while nothing is measured
  NodalForces forces;  ///< empty while nothing is measured
  std::vector<Contact> contacts;
  Vec3 total_force_n = Vec3::Zero();  ///< sum over the contacts
  double baseline_age_s = 0;          ///< from when the baseline was taken to the exposure
  Baseline baseline;
  StageTimes stage_ms;
  std::optional<SimulationReport>
      simulation;         ///< what is true of a simulated link; none: it is not simulated
  bool replayed = false;  ///< from a log: the UTC times are those of then

  bool measured() const { return !shape.positions_mm.empty(); }
  /// False: nothing is measured, or what was found can't be trusted; then no contacts do not say that nothing
  /// presses. Holds at every level of detail.
  bool has_forces() const {
    return (status == LinkStatus::kOk || status == LinkStatus::kDegraded) && forces.converged;
  }
  /// Sum of the contacts' magnitudes, N; NaN: the forces are not known.
  double total_magnitude_n() const;
  /// All fields of the measurement back to their defaults (see link_state_fields.h); buffers stay.
  void ClearMeasurement();
};

/// Whether it is certain which contacts a frame has: forces are known, and no reason doubts it.
bool AreContactsCertain(const LinkState& state);

/// Adds a reason that is found only after the frame was judged, which makes the state worse, never better: an
/// OK one is degraded, a degraded one keeps its first reason, and any other stays as it is.
void Degrade(LinkState& state, Reason reason);

}  // namespace taclink
