#pragma once

#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/scene.h"

namespace taclink {

/// A place on a link's profile.
struct SkinSpot {
  double angle_rad = 0, z_mm = 0;
};

/// A scene's contact on a certain link: where it is and how hard it presses, over the scene's time.
struct ContactPlan {
  SkinSpot from, to;
  bool moves = false;
  double begin_s = 0, end_s = 0, ramp_s = 0;

  /// 0 where it does not press, 1 where it does so fully. Continuously differentiable if there are ramps.
  double Level(double time_s) const;
  /// Goes on at its speed before the beginning and after the end.
  SkinSpot SpotAt(double time_s) const;
};

/// Errors: kInvalidArgument (too many contacts, no pressure, a contact that is not on this model; with the
/// scene's file and line).
Result<std::vector<ContactPlan>> PlanContacts(const LinkModel& model, const Scene& scene);

/// How deep a contact may go, mm along the normal: until the inner wall all but meets the tube, or the axis.
double MostDepth(const LinkModel& model, const SkinSpot& spot);

/// No inner wall is nearer to the axis: the tube's radius, mm.
double NearestWall(const LinkModel& model);

}  // namespace taclink
