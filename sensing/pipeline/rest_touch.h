#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/markers.h"

namespace taclink {

/// A touch that explains where rest images have their markers.
struct RestTouch {
  int marker = 0;          ///< nearest to it
  bool is_around = false;  ///< the same inward force acts on all markers of its ring
  double depth_mm = 0;     ///< about: to first order
  double share = 0;        ///< of the squared residuals that the touch explains
};

/// Whether the skin is touched in its rest images: a generalized likelihood ratio test [kay1998] of up to two
/// inward forces, each at a marker or alike at all markers of a ring, against none, or another pressure.
/// Errors of the cameras (all parameters of `rig`), of the mould (`mould_mm`, standard deviation of each
/// marker's coordinates and of each smooth radial harmonic) and of the known loads (shape.errors_mm) are
/// nuisance parameters, so that the cameras may be fitted to the same images or have moved since. A touch is
/// found if it is significant and explains most of what the nuisance parameters leave; thereby errors of the
/// mould that are larger than assumed are no touch. `responses`: TouchResponses under the same loads. `rest`:
/// labels of all seen markers, outliers of the cameras' fit included. nullopt: not touched.
std::optional<RestTouch> FindRestTouch(const RestShape& shape, const Eigen::MatrixXf& responses,
                                       const StereoRig& rig, const LabelledMarkers& rest, double mould_mm);

/// Where it is, and what to do.
std::string Describe(const LinkModel& model, const RestTouch& touch);

}  // namespace taclink
