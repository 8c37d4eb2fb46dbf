#pragma once

#include <optional>

#include "sensing/acceptance/acceptance.h"
#include "sensing/core/link_state.h"

namespace taclink {

/// Averages a link's frames into the reading of one phase of a trial. One thread.
class ReadingCollector {
 public:
  /// `place_mm`: place of the load, link frame. All contacts within `near_mm` of it belong to the load, since
  /// one body may be found as several contacts; others count as phantom forces. None: all contacts belong to
  /// the load. `keeps_held`: also records the force over time, one sample a second.
  explicit ReadingCollector(std::optional<Vec3> place_mm, double near_mm = kSameContactMm,
                            bool keeps_held = false);

  void Add(const LinkState& state);
  int frames() const { return reading_.frames; }
  double duration_s() const { return reading_.duration_s; }
  /// The means so far.
  TrialReading Reading() const;

 private:
  /// The load's contacts in one frame, or summed over frames.
  struct Load {
    int frames = 0;
    double force_n = 0, force2_n2 = 0, variance_n2 = 0;
    bool has_variance = true;
    Vec3 moment_nmm = Vec3::Zero();  ///< center times force
  };
  void AddReasons(const LinkState& state);
  void AddLoad(const LinkState& state);
  void AddHeld(double force_n);

  // Constant after construction.
  const std::optional<Vec3> place_mm_;
  const double near_mm_;
  const bool keeps_held_;

  TrialReading reading_;  // sums in place of the means
  Load load_;
  int64_t first_ns_ = 0;  // monotonic
  double pressure_sum_mpa_ = 0;
  int pressures_ = 0;
  HeldSample second_;  // sums over the current second
  int second_frames_ = 0;
};

}  // namespace taclink
