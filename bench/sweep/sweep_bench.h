#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"

namespace taclink {

/// The places that one link presses in turn: all rings of a path, and the cells next to them.
struct SweepUnit {
  std::string model;
  double pressure_kpa = 0;
  int path = 1;

  auto operator<=>(const SweepUnit&) const = default;
};

/// One disc pressed against the skin: the link's answer and the truth.
struct SweepContact {
  SweepUnit unit;
  int ring = 1;             ///< from 1
  bool is_cell = false;     ///< half a pitch further along and around: between four markers
  double depth_mm = 0;      ///< requested, along the normal from the undeformed surface
  bool is_limited = false;  ///< the tube limits the depth to less than requested
  double true_n = 0;
  bool has_forces = false;     ///< the link reports forces
  bool is_ok = false;          ///< and its status is OK
  double found_n = 0;          ///< sum over contacts within 25 mm (scaled) of the disc; 0: none
  double force_error_n = 0;    ///< magnitude of the difference of the force vectors
  double center_error_mm = 0;  ///< of their common center; 0: none found
  double phantom_n = 0;        ///< sum of the forces further away
  double balance_n = 0;        ///< |sum of all forces of the link - true force|
  std::string reasons = {};    ///< names of the reasons of frames that are not OK, separated by spaces
};

struct SweepOptions {
  std::vector<SweepUnit> units;
  int jobs = 1;
  /// Receives the contacts of one unit; called from the workers, one at a time. `failure`: why the skin could
  /// not be simulated at some place; the contacts before it are included.
  std::function<void(const std::vector<SweepContact>& contacts, const std::string& failure)> done;
};

/// Number of contacts of a unit of this model.
size_t SweepContactsOfUnit(const LinkModel& model);
/// All units of these models and pressures. Every eighth path comes first, so that an interrupted sweep
/// covers evenly spread paths of each skin and pressure.
std::vector<SweepUnit> SweepUnits(const std::vector<LinkModel>& models,
                                  const std::vector<double>& pressures_kpa);

/// From rendered images to forces with default settings: each link takes its rest shape and calibrates its
/// cameras without pressure, is inflated, and is pressed to three depths at every place. The cameras are
/// misaligned by 0.3 mm and 0.3 degrees (standard deviations by axis); images have noise, markers jitter by
/// 0.15 px.
void RunSweep(const std::vector<LinkModel>& models, const SweepOptions& options);

}  // namespace taclink
