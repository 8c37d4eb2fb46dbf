#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink::server {

enum class ForceLevel : uint8_t { kNormal, kWarning, kAlarm };

/// Of the strongest contact's force. A level is entered at its threshold and left below it by `hysteresis_n`.
struct Thresholds {
  double warning_n = 0;  ///< 0: none
  double alarm_n = 0;    ///< 0: none
  double hysteresis_n = 0.05;
};

/// A part of the marker grid; rings and paths from 0, inclusive. Paths go round: first > last crosses path 0.
struct Region {
  std::string name;
  int first_ring = 0, last_ring = 0;
  int first_path = 0, last_path = 0;
  Thresholds thresholds = {};

  bool Holds(int path, int ring) const {
    const bool in_paths = first_path <= last_path ? path >= first_path && path <= last_path
                                                  : path >= first_path || path <= last_path;
    return in_paths && ring >= first_ring && ring <= last_ring;
  }
};

struct LinkRules {
  Thresholds thresholds;
  std::vector<Region> regions;
};

struct EventOptions {
  int history = 10'000;        ///< events kept for clients that come back
  double begin_n = 0.05;       ///< a contact begins at this force
  double end_n = 0.03;         ///< and ends below this one
  double release_s = 0.15;     ///< after so long
  double update_rate_hz = 5;   ///< at most, of each contact
  double drift_step_mm = 0.1;  ///< drift is told in steps
  std::string audit;           ///< file; empty: none
  int audit_max_kb = 1024;     ///< then it is renamed to FILE.1, and a new one begins
};

/// Errors: kInvalidArgument (not 0 <= hysteresis < warning <= alarm, absurd).
Result<void> CheckThresholds(const Thresholds& thresholds);
/// Errors: kInvalidArgument (a region outside the model's grid; thresholds).
Result<void> CheckRules(const LinkRules& rules, const MarkerGrid& grid);

}  // namespace taclink::server
