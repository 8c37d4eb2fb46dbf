#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/pipeline/drift_options.h"

namespace taclink {

/// Decides when the baseline follows the skin, and how far. A load stops it at once; only a while without any
/// load lets it go on, so that a steady contact never fades. What it may take of a contact before that is
/// felt is bounded by the rate limit. Allocates at construction only.
class DriftFollower {
 public:
  DriftFollower(int markers, const DriftOptions& options);

  /// A new baseline.
  void Reset();

  /// One frame. `load_n`: the strongest load in it; none: not known, which holds the baseline. `off_mm`: by
  /// marker, how far it is from where the baseline was taken, pressure's part left out; used while following.
  void Update(int64_t time_ns, std::optional<double> load_n, std::span<const Vec3> off_mm);

  /// By marker, since Reset.
  std::span<const Vec3> drift_mm() const { return drift_mm_; }
  /// Of the marker that went furthest.
  double largest_mm() const { return largest_mm_; }
  bool following() const { return following_; }

 private:
  void Follow(double seconds, std::span<const Vec3> off_mm);

  DriftOptions options_;
  std::vector<Vec3> drift_mm_;
  double largest_mm_ = 0;
  bool following_ = false;
  std::optional<int64_t> last_ns_;
  int64_t quiet_since_ns_ = 0;  // while held
};

}  // namespace taclink
