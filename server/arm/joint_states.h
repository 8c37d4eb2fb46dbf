#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/result.h"
#include "server/arm/arm_kinematics.h"
#include "server/config/options.h"

namespace taclink::server {

/// How far the positions of an instant can be trusted; rises from best to worst.
enum class PoseValidity : uint8_t {
  kFixed,         ///< no joint is involved
  kInterpolated,  ///< joint states before and after that instant, or at it
  kExtrapolated,  ///< the newest joint states are a little older
  kStale,         ///< they are older than is allowed: held where they were
  kUnknown,       ///< a joint never had a state; it counts as 0, or the end of its range nearest to that
};

/// Joint states of one instant. `joints` are indices of the joints given.
struct JointStates {
  int64_t time_ns = 0;  ///< monotonic
  std::span<const size_t> joints;
  std::span<const double> positions;   ///< rad or m, as many
  std::span<const double> velocities;  ///< rad/s or m/s, as many; or none
};

/// One state of one joint.
struct JointSample {
  int64_t time_ns = 0;  ///< monotonic
  double position = 0;
  std::optional<double> velocity;
};

/// The joints' last positions over time. Several may write, each the joints it knows; any thread.
class JointStateBuffer {
 public:
  JointStateBuffer(std::vector<JointInfo> joints, JointStateOptions options = {});

  /// How many of the joints were taken; a joint that has a state of this time or a newer one is left as it
  /// is. Errors: kInvalidArgument, with nothing taken (numbers that are none, or too far beyond a joint's
  /// range to be rad or m).
  Result<size_t> Add(const JointStates& states);

  struct Instant {
    std::vector<double> positions;       ///< by joint
    std::vector<PoseValidity> validity;  ///< by joint, never kFixed
    std::vector<int64_t> distance_ns;    ///< by joint: to the nearest state; -1: none
  };
  /// Where the joints are, or were, at a monotonic time; `out`'s buffers are reused.
  void At(int64_t time_ns, Instant& out) const;

  /// A joint's states after a monotonic time that are still kept, oldest first.
  std::vector<JointSample> After(size_t joint, int64_t time_ns) const;

  const std::vector<JointInfo>& joints() const { return joints_; }
  const JointStateOptions& options() const { return options_; }

 private:
  using Sample = JointSample;
  /// The last samples of a joint, oldest first.
  struct Track {
    std::vector<Sample> ring;
    size_t first = 0, count = 0;
    const Sample& At(size_t place) const { return ring[(first + place) % ring.size()]; }
    void Push(const Sample& sample);
  };
  struct Estimate {
    double position = 0;
    PoseValidity validity = PoseValidity::kUnknown;
    int64_t distance_ns = -1;
  };

  Result<void> Check(const JointStates& states) const;
  Estimate EstimateAt(size_t joint, int64_t time_ns) const;
  Estimate Beyond(const Sample& sample, int64_t time_ns) const;
  Estimate Between(const Sample& before, const Sample& after, int64_t time_ns, bool continuous) const;

  // Constant after construction.
  const std::vector<JointInfo> joints_;
  const JointStateOptions options_;
  const int64_t extrapolate_ns_, stale_ns_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<Track> tracks_;  // by joint
};

}  // namespace taclink::server
