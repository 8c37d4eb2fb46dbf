#pragma once

namespace taclink {

/// How a baseline follows a skin that creeps. Forces are those of the strongest load.
struct DriftOptions {
  double time_constant_s = 60;
  double rate_limit_mm_s = 0.001;  ///< of each marker; nothing that moves faster than this is followed
  double limit_mm = 0.5;           ///< further than this from where it was taken, the link is degraded
  double stop_n = 0.02;            ///< above: touched
  double go_n = 0.01;              ///< not above, for `quiet_s`: untouched
  double quiet_s = 5;
};

}  // namespace taclink
