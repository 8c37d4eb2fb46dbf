#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"

namespace taclink {

/// What of a skin is pressed at once, one place after the other: all rings of a path, and the cells behind
/// them.
struct SweepUnit {
  std::string model;
  double pressure_kpa = 0;
  int path = 1;

  auto operator<=>(const SweepUnit&) const = default;
};

/// One disc against the skin: what the link answered, and the truth.
struct SweepContact {
  SweepUnit unit;
  int ring = 1;             ///< from 1
  bool is_cell = false;     ///< half a pitch further along and around: between four markers
  double depth_mm = 0;      ///< as asked for, along the normal from the undeformed surface
  bool is_limited = false;  ///< pressed less deep than asked: the tube is in the way
  double true_n = 0;
  bool has_forces = false;     ///< the link answers with forces
  bool is_ok = false;          ///< and without a reservation (status OK)
  double found_n = 0;          ///< of the contacts within 25 mm (scaled) of the disc; 0: none
  double force_error_n = 0;    ///< magnitude of the difference of the force vectors
  double center_error_mm = 0;  ///< of their common center; 0: none was found
  double phantom_n = 0;        ///< sum of the forces further away
  double balance_n = 0;        ///< magnitude of the sum of all forces of the link less the true one
  std::string reasons = {};    ///< of a frame that is not OK, names with spaces between
};

struct SweepOptions {
  std::vector<SweepUnit> units;
  int jobs = 1;
  /// The contacts of one unit; called from the workers, one at a time. `failure`: why the skin could not be
  /// simulated at some place; the contacts before it are there.
  std::function<void(const std::vector<SweepContact>& contacts, const std::string& failure)> done;
};

/// How many contacts a unit of this model has.
size_t SweepContactsOfUnit(const LinkModel& model);
/// All units of these models and pressures.
std::vector<SweepUnit> SweepUnits(const std::vector<LinkModel>& models,
                                  const std::vector<double>& pressures_kpa);

/// From rendered images to forces with default settings: each link takes its rest shape and calibrates its
/// cameras without pressure, is inflated, and is pressed to three depths everywhere. The cameras are mounted
/// off the model's places by 0.3 mm and 0.3 degrees; images have noise, markers jitter by 0.15 px.
void RunSweep(const std::vector<LinkModel>& models, const SweepOptions& options);

}  // namespace taclink
