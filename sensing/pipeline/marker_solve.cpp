#include "sensing/pipeline/marker_solve.h"

#include <utility>

#include "sensing/pipeline/judge.h"

namespace taclink {

LinkState SolveMarkers(const LinkModel& model, StateEstimator& estimator, const PressurePair& pressure,
                       SkinShape shape) {
  LinkState state;
  state.shape = std::move(shape);
  ContactFinder finder(model);
  estimator.Estimate(pressure, finder, state.shape, state.forces, state.contacts);
  for (const Contact& contact : state.contacts) state.total_force_n += contact.force_n;
  const SkinEstimate& estimate = estimator.estimate();
  if (state.forces.converged)
    state.pressure_estimate = {estimate.pressure_mpa, estimate.loads.pressure_sigma_mpa};
  Judge(
      {.model = model, .camera_trouble = "", .drift_advice = "", .told = pressure.now, .estimate = estimate},
      state);
  return state;
}

}  // namespace taclink
