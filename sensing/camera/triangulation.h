#pragma once

#include <optional>

#include "sensing/core/geometry.h"

namespace taclink {

/// A ray in the link frame: origin in mm, unit direction.
struct SightRay {
  Vec3 origin = Vec3::Zero();
  Vec3 direction = Vec3::Zero();

  /// Where it passes a plane z = const; None: parallel to it, or behind the origin.
  std::optional<Vec3> AtZ(double z_mm) const;
};

/// The middle of the shortest line between two rays [hartley1997], and that line's length.
struct RayMeeting {
  Vec3 point_mm = Vec3::Zero();
  double gap_mm = 0;
};

/// To label and check markers. None: the rays are parallel, or pass nearest behind one of the origins.
std::optional<RayMeeting> MeetRays(const SightRay& a, const SightRay& b);

}  // namespace taclink
