#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/camera/triangulation.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"

namespace taclink {

struct LabelCheckOptions {
  double max_ray_gap_mm = 1.2;  ///< between both cameras' rays to a marker, beside what their noise explains
  double max_z_error = 0.35;    ///< of a marker off its ring's z at rest, ring pitches
  double max_outward_mm = 15;   ///< beyond the radius at rest
  double min_step_px = 0.2;     ///< from ring to ring along a path in the picture
  /// Two markers of a path nearer than this part of their size and a pixel can't be told apart: the one
  /// further from the camera is dropped.
  double min_apart = 0.45;
};

/// Says which labels contradict the geometry. Constant after construction but for scratch memory: one thread.
class LabelCheck {
 public:
  LabelCheck(const LinkModel& model, const StereoRig& rig, LabelCheckOptions options = {});

  struct Pair {
    bool holds = false;
    Vec3 point_mm = Vec3::Zero();  ///< where the rays meet
  };
  /// Both cameras' rays to a marker meet, on its ring and within reach of the skin. `pixels`: by camera.
  Pair CheckPair(int marker, const std::array<Vec2, kCameraCount>& pixels, double sigma_px) const;

  /// How far the meeting point would be off along z if that camera took the next ring's marker for this one.
  double SlipMm(CameraId id, int marker, const Vec3& point_mm) const;
  /// Sets doubtful[marker] for labels out of order along their path, and for those that share a spot: for
  /// both of two, or for the one that is `fresh`, this is, has just been found.
  void CheckPicture(CameraId id, const std::vector<MarkerObservation>& labels,
                    const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful);

  /// In the picture; nearer ones of a path can't be told apart.
  double LeastDistancePx(CameraId id, int marker) const {
    return options_.min_apart * views_[Index(id)].sizes_px[static_cast<size_t>(marker)] + 1;
  }

  double middle_z_mm() const {
    return 0.5 * (views_[0].projector.center_in_link().z() + views_[1].projector.center_in_link().z());
  }
  const Projector& projector(CameraId id) const { return views_[Index(id)].projector; }

 private:
  struct View {
    Projector projector;
    std::vector<double> sizes_px;  // of the markers at rest, the longer axis
    std::vector<Vec2> directions;  // of the paths in the picture, rising z, unit
    std::vector<int16_t> cells;    // of the picture, kCell px wide: a marker there, or -1
    int columns = 0, rows = 0;
  };
  void CheckOrder(CameraId id, const std::vector<MarkerObservation>& labels,
                  const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful) const;
  static void CheckSharing(View& view, const std::vector<MarkerObservation>& labels,
                           const std::vector<uint8_t>& fresh, std::vector<uint8_t>& doubtful);

  const LabelCheckOptions options_;
  int paths_, rings_;
  double tube_radius_mm_;
  std::vector<Vec3> rest_mm_;
  std::vector<double> ring_pitch_mm_;  // to the nearer neighbour
  std::vector<View> views_;            // by camera
};

}  // namespace taclink
