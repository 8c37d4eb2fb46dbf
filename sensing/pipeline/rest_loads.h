#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/known_loads.h"
#include "sensing/core/markers.h"

namespace taclink {

/// The rest shape under known loads, with what the errors of their specific force (SpecificForceErrors) do to
/// it; none: no skin is stable under them.
using RestShapeAt = std::function<std::optional<RestShape>(const MeasuredLoads& loads)>;

/// What a link's mechanics say of its rest images.
struct RestSkin {
  RestShapeAt shape_at;
  /// TouchResponses under these loads; none: no skin is stable under them.
  std::function<std::optional<Eigen::MatrixXf>(const MeasuredLoads& loads)> touch_responses_at;
};

/// Independent errors of the specific force of one standard deviation each, in columns, m/s^2.
Mat3 SpecificForceErrors(const MeasuredLoads& loads);

/// The errors of the specific force move markers of the rest shape so far that it must be estimated.
bool IsRestUncertain(const RestShape& shape);

/// A specific force of which nothing is measured but that the link rests, so that its magnitude is gravity's.
bool IsAttitudeUnknown(const MeasuredLoads& loads);

/// Where to begin to look for the loads of rest images, the measured ones first: of an unknown attitude also
/// gravity across the link in all directions, so close to each other that labels are right at one of them.
std::vector<MeasuredLoads> RestGuesses(const MeasuredLoads& measured);

/// The magnitude of gravity as one more measurement of the specific force (an update of the extended Kalman
/// filter), with a standard deviation in m/s^2; the default is that of a link at rest and of its model's
/// weight.
void MeasureGravity(MeasuredLoads& loads, double sigma_mps2 = 0.1);

/// The specific force that rest images of known cameras show, with its covariance: Gauss-Newton on a robust
/// sum of residuals (Huber's, iteratively reweighted [huber1981]) and the prior, for something may touch the
/// skin. `measured`: the prior. None: no skin is stable there.
std::optional<MeasuredLoads> FitRestLoads(const MeasuredLoads& measured, const RestShapeAt& shape_at,
                                          const StereoRig& rig, const LabelledMarkers& rest);

}  // namespace taclink
