#pragma once

#include <memory>
#include <optional>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"

namespace taclink {

struct ForceOptions {
  /// None: the cheapest model whose estimated error is below `tolerance`, frame by frame.
  std::optional<ForceModel> model = ForceModel::kLinear;
  double tolerance = 0.05;  ///< of the forces, as a fraction
  /// Elements per interval of the marker grid; 0: what each model does best with.
  int refinement = 0;
  /// How often noise alone may make a contact, at 30 frames a second.
  double phantoms_per_hour = 1;
  /// A load is believed if it explains the displacements by this many standard deviations; 0: as follows from
  /// the above.
  double significance = 0;
  /// Smallest standard deviation given to a marker, mm; detections correlate, so covariances alone are too
  /// proud.
  double noise_floor_mm = 0.03;
};

/// From marker displacements to what the world exerts on the skin. Holds scratch memory: one thread.
class ForceEstimator {
 public:
  ForceEstimator() = default;
  ForceEstimator(const ForceEstimator&) = delete;
  ForceEstimator& operator=(const ForceEstimator&) = delete;
  virtual ~ForceEstimator() = default;
  /// Uses the shape's measured displacements; its others are not independent of each other. `pressure_mpa`:
  /// gauge pressure now less that of the baseline. `forces`' buffers are reused.
  virtual void Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) = 0;
  /// Forgets the frames before.
  virtual void Restart() {}
};

/// Takes from a tenth of a second to some seconds: factorises the skin's stiffness.
std::unique_ptr<ForceEstimator> MakeForceEstimator(const LinkModel& model, const ForceOptions& options);

}  // namespace taclink
