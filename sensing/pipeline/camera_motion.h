#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/pipeline/marker_radii.h"

namespace taclink {

/// How two cameras differ in what they see of the skin's motion.
struct MotionDisagreement {
  CameraId camera;    ///< that is late; or else the one that saw motion which the other did not
  double late_s = 0;  ///< by how much; 0: that is not known
};

/// Watches whether both cameras see the skin move, at the same time and in the same places. Lines of sight
/// that meet tell little of that: both cameras sit on the link's axis, so that a picture that lags behind, or
/// a camera that moves itself, looks like a skin that is dragged along. A skin that is pressed or let go
/// moves along its normal, which both see: in each picture by itself a marker has a radius, and that it
/// changes in both at once is what is watched.
///
/// Two signs tell. At an onset only one camera moves. Later, where the one camera's steps follow the other's
/// after a while better than at once (the largest correlation over time shifts), it lags by that while: a
/// drag along the axis makes the two different, but not later. Single pictures that come twice or out of turn
/// are no lag. One thread.
class CameraMotion {
 public:
  /// `noise_px`: see RadiusReader.
  CameraMotion(const LinkModel& model, const StereoRig& rig, double noise_px);

  void Observe(const FrameTimes& times, const LabelledMarkers& markers);

  /// None: both see the same. What one saw alone is held against the other until the skin was at rest for
  /// two seconds, for its pictures may still be behind; a lag until a motion fits better
  /// without it.
  std::optional<MotionDisagreement> disagreement() const;

 private:
  void Take(int64_t now_ns, const LabelledMarkers& markers);

  std::optional<SeenMotion> CompareWith(int frames_ago, double most_seen) const;
  std::optional<SeenMotion> Onset();
  bool IsHeld(int64_t now_ns) const;

  struct Moment;
  struct EvenTimes;
  struct Shift;
  struct Steps;
  std::vector<Eigen::Index> MovedLately() const;
  EvenTimes Times() const;
  float SteadyMm(size_t camera, const Moment& moment, Eigen::Index marker) const;
  Steps StepsOf(const std::vector<Eigen::Index>& markers, const EvenTimes& times, int step) const;
  std::vector<Shift> Follow() const;
  void TakeLag(const std::vector<Shift>& shifts);
  static bool AreTogether(const std::vector<Shift>& shifts);

  // Of the newest frame and of earlier ones.
  size_t Place(int frames_ago) const;
  const MarkerRadii& Radii(int frames_ago) const { return radii_[Place(frames_ago)]; }
  int64_t ExposureNs(int frames_ago) const { return exposures_ns_[Place(frames_ago)]; }
  int64_t AgoNs(int frames_ago) const { return ExposureNs(0) - ExposureNs(frames_ago); }
  bool Has(int frames_ago) const { return frames_ago < frames_; }

  const double length_unit_;
  RadiusReader reader_;

  std::vector<MarkerRadii> radii_;  // by frame, a ring of frames
  std::vector<int64_t> exposures_ns_;
  int frames_ = 0;  // in the ring that belong together
  size_t newest_ = 0;

  std::optional<CameraId> suspect_;       // in the last frame in which the skin had moved
  int64_t suspect_ns_ = 0;                // its exposure
  int64_t onset_ns_ = 0;                  // that before which the motion began in which it was suspected
  std::optional<int64_t> held_until_ns_;  // exposure
  std::optional<CameraId> alone_;
  std::optional<double> lag_s_;  // of the top camera; negative: of the bottom camera
};

}  // namespace taclink
