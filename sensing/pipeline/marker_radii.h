#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"

namespace taclink {

/// A marker has moved: so far that either camera would see it.
inline constexpr float kMovedDeviations = 5;
inline constexpr int kLeastMoved = 4;  ///< markers, or the skin has not
/// Root mean square of these, in units of length, from which the skin has moved.
inline constexpr double kLeastMovedMm = 0.2;
/// What the other camera sees of it. A press is 0.9 and more; what drags the skin purely along the axis is
/// below -0.5 where markers are compared. Between, there is only a drag along a line of sight of that camera.
inline constexpr double kMostSeen = 0.25;

/// Radii of the compared markers, mm, as each camera by itself sees them. NaN: not seen sharply.
struct MarkerRadii {
  std::array<Eigen::ArrayXf, kCameraCount> mm;
  Eigen::ArrayXf variances_mm2;  ///< the larger of both cameras'
};

/// Reads markers' radii in each picture by itself: where the line of sight crosses the plane across the link
/// that the marker has at rest. A skin that is pressed or let go moves along its normal, which changes them
/// in both pictures alike; what drags it along the axis changes them in opposite ways, and a picture of
/// another moment, or a camera that moves, in one alone. One thread.
class RadiusReader {
 public:
  /// `noise_px`: how much a marker's place in a picture scatters, each axis, where detections tell less.
  RadiusReader(const LinkModel& model, const StereoRig& rig, double noise_px);

  /// Markers that both cameras see well enough to be compared.
  const std::vector<int>& compared() const { return compared_; }
  void Read(const LabelledMarkers& markers, MarkerRadii& radii);
  /// Makes `radii` those of no marker; nothing is allocated afterwards.
  void Forget(MarkerRadii& radii) const;
  /// How a camera sees the radius of `compared()[m]` change as the marker moves, mm per mm; of the markers
  /// that were read last.
  const Vec3& ByPlace(size_t m, CameraId id) const { return gauges_[Index(id)][m].by_place; }

 private:
  /// Linearized about a pixel close by.
  struct Gauge {
    bool is_set = false;
    Vec2 about_px = Vec2::Zero(), by_px = Vec2::Zero();  // by_px: mm/px
    Vec3 by_place = Vec3::Zero();                        // mm/mm
    double radius_mm = 0;
  };
  struct Reading {
    double mm = 0, variance_mm2 = 0;
  };
  std::optional<Reading> ReadOne(size_t m, CameraId id, const MarkerObservation& seen);

  const LinkModel model_;
  const double length_unit_, noise_px_;
  const std::array<Projector, kCameraCount> projectors_;
  std::vector<int> compared_;
  std::array<std::vector<Gauge>, kCameraCount> gauges_;  // by compared marker
};

/// That the skin has moved; `alone`: the camera that saw it alone.
struct SeenMotion {
  std::optional<CameraId> alone;
};

/// Of the markers whose radius changed by far more than noise, the changes in the picture that shows less are
/// regressed on those in the one that shows more. `least_mm`: root mean square from which the skin has moved;
/// `most_seen`: slope below which a camera saw it alone. None: it has not moved.
std::optional<SeenMotion> CompareRadii(const MarkerRadii& before, const MarkerRadii& now, double least_mm,
                                       double most_seen);

}  // namespace taclink
