#include "server/arm/joint_states.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "sensing/core/geometry.h"

namespace taclink::server {
namespace {

// Real joints stand a little beyond their range; degrees taken for radians stand far beyond it.
constexpr double kBeyondRange = 0.2;  // rad or m
// No joint turns so often, and no double is still exact to a microradian far above.
constexpr double kLargestPosition = 1e6;

double HomeOf(const JointInfo& joint) {
  return joint.limits ? std::clamp(0.0, joint.limits->lower, joint.limits->upper) : 0;
}

Error Invalid(const JointInfo& joint, const std::string& what) {
  return {ErrorCode::kInvalidArgument, "joint '" + joint.name + "': " + what};
}

std::string Text(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

JointStateBuffer::JointStateBuffer(std::vector<JointInfo> joints, JointStateOptions options)
    : joints_(std::move(joints)),
      options_(options),
      extrapolate_ns_(std::chrono::nanoseconds(options.extrapolate).count()),
      stale_ns_(std::chrono::nanoseconds(options.stale_after).count()),
      tracks_(joints_.size()) {
  for (Track& track : tracks_) track.ring.resize(std::max<size_t>(options.capacity, 2));
}

void JointStateBuffer::Track::Push(const Sample& sample) {
  ring[(first + count) % ring.size()] = sample;
  if (count < ring.size()) {
    ++count;
  } else {
    first = (first + 1) % ring.size();
  }
}

Result<void> JointStateBuffer::Check(const JointStates& states) const {
  for (size_t i = 0; i < states.joints.size(); ++i) {
    const JointInfo& joint = joints_[states.joints[i]];
    const double position = states.positions[i];
    if (!std::isfinite(position) || std::abs(position) > kLargestPosition)
      return Invalid(joint, "position " + Text(position) + " is no position in rad or m");
    if (!states.velocities.empty() && !std::isfinite(states.velocities[i]))
      return Invalid(joint, "velocity " + Text(states.velocities[i]) + " is no velocity in rad/s or m/s");
    if (joint.limits &&
        (position < joint.limits->lower - kBeyondRange || position > joint.limits->upper + kBeyondRange)) {
      return Invalid(joint, "position " + Text(position) + " is far outside its range, " +
                                Text(joint.limits->lower) + " to " + Text(joint.limits->upper) +
                                (joint.kind == JointKind::kPrismatic ? " m" : " rad") +
                                "; check unit and URDF");
    }
  }
  return {};
}

Result<size_t> JointStateBuffer::Add(const JointStates& states) {
  if (const auto good = Check(states); !good) return good.error();
  size_t taken = 0;
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < states.joints.size(); ++i) {
    Track& track = tracks_[states.joints[i]];
    if (track.count > 0 && track.At(track.count - 1).time_ns >= states.time_ns) continue;
    track.Push({.time_ns = states.time_ns,
                .position = states.positions[i],
                .velocity = states.velocities.empty() ? std::nullopt : std::optional(states.velocities[i])});
    ++taken;
  }
  return taken;
}

void JointStateBuffer::At(int64_t time_ns, Instant& out) const {
  out.positions.resize(joints_.size());
  out.validity.resize(joints_.size());
  out.distance_ns.resize(joints_.size());
  const std::lock_guard lock(mutex_);
  for (size_t joint = 0; joint < joints_.size(); ++joint) {
    const Estimate estimate = EstimateAt(joint, time_ns);
    out.positions[joint] = estimate.position;
    out.validity[joint] = estimate.validity;
    out.distance_ns[joint] = estimate.distance_ns;
  }
}

std::vector<JointSample> JointStateBuffer::After(size_t joint, int64_t time_ns) const {
  const std::lock_guard lock(mutex_);
  const Track& track = tracks_[joint];
  size_t first = track.count;
  while (first > 0 && track.At(first - 1).time_ns > time_ns) --first;
  std::vector<JointSample> samples;
  for (size_t i = first; i < track.count; ++i) samples.push_back(track.At(i));
  return samples;
}

JointStateBuffer::Estimate JointStateBuffer::EstimateAt(size_t joint, int64_t time_ns) const {
  const Track& track = tracks_[joint];
  if (track.count == 0) return {.position = HomeOf(joints_[joint])};
  size_t low = 0, high = track.count;  // the first sample after time_ns
  while (low < high) {
    const size_t middle = (low + high) / 2;
    if (track.At(middle).time_ns <= time_ns) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (low == 0 || low == track.count) return Beyond(track.At(low == 0 ? 0 : low - 1), time_ns);
  return Between(track.At(low - 1), track.At(low), time_ns, joints_[joint].kind == JointKind::kContinuous);
}

// Newer than the newest or older than the oldest.
JointStateBuffer::Estimate JointStateBuffer::Beyond(const Sample& sample, int64_t time_ns) const {
  const int64_t distance_ns = std::abs(time_ns - sample.time_ns);
  const int64_t continued_ns = std::clamp(time_ns - sample.time_ns, -extrapolate_ns_, extrapolate_ns_);
  Estimate out{
      .position = sample.position + sample.velocity.value_or(0) * 1e-9 * static_cast<double>(continued_ns),
      .validity = PoseValidity::kExtrapolated,
      .distance_ns = distance_ns};
  if (distance_ns == 0) out.validity = PoseValidity::kInterpolated;
  if (distance_ns > stale_ns_) out.validity = PoseValidity::kStale;
  return out;
}

// A cubic where both velocities are known, else straight.
JointStateBuffer::Estimate JointStateBuffer::Between(const Sample& before, const Sample& after,
                                                     int64_t time_ns, bool continuous) const {
  const auto span_ns = static_cast<double>(after.time_ns - before.time_ns);
  const double part = static_cast<double>(time_ns - before.time_ns) / span_ns;
  double step = after.position - before.position;
  if (continuous) step = std::remainder(step, 2 * kPi);  // 3.1 to -3.1 is the short way round
  double moved = part * step;
  if (before.velocity && after.velocity) {
    const double span_s = span_ns * 1e-9, rest = 1 - part;
    moved = step * part * part * (3 - 2 * part) +
            span_s * part * rest * (*before.velocity * rest - *after.velocity * part);
  }
  const int64_t distance_ns = std::min(time_ns - before.time_ns, after.time_ns - time_ns);
  return {.position = before.position + moved,
          .validity = distance_ns > stale_ns_ ? PoseValidity::kStale : PoseValidity::kInterpolated,
          .distance_ns = distance_ns};
}

}  // namespace taclink::server
