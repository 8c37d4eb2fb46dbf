#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sensing/core/baseline.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/marker_mean.h"
#include "sensing/pipeline/mean_loads.h"

namespace taclink {

/// Averages the frames that become a new baseline, and says why they can't.
class TareCollector {
 public:
  TareCollector(const LinkModel& model, const TareOptions& options);

  /// Takes a solved frame. `off_mm`: by marker, how far it is from where the old baseline was taken,
  /// pressure's part left out; empty where nothing is measured. True: complete. Errors: kFailedPrecondition
  /// (nothing is measured; unless forced also touched, moved, another pressure, too few markers).
  Result<bool> Add(const LinkState& state, const LabelledMarkers& labels, std::span<const Vec3> off_mm,
                   const MeasuredLoads& loads);

  /// Once complete: the mean, what it is off the old baseline, and whether it took force.
  const LabelledMarkers& markers() const { return mean_.markers(); }
  MeasuredLoads loads() const { return loads_.mean(); }
  double shift_mm() const;
  bool forced() const { return forced_; }
  int frames() const { return mean_.frames(); }

 private:
  std::optional<Error> Objection(const LinkState& state) const;
  std::optional<Error> Motion() const;

  const TareOptions options_;
  const double touched_n_, moved_mm_;
  const int markers_;
  MarkerMean mean_;
  MeanLoads loads_;
  std::vector<Vec3> first_half_mm_, second_half_mm_;  // sums of what is off
  bool forced_ = false;
};

}  // namespace taclink
