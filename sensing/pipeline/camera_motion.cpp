#include "sensing/pipeline/camera_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>

#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

// Frames nearer to the one before are left out; after a longer pause comparison begins again.
constexpr int64_t kStepNs = 15'000'000, kLongestNs = 250'000'000;
// Frames that are remembered: more than the window and the longest lag at 66 Hz.
constexpr size_t kRing = 128;
// An onset is looked for over so long.
constexpr int64_t kOnsetNs = 500'000'000;
// For so long pictures may be behind, and what was wrong with a moving skin may still be in an answer.
constexpr int64_t kHoldNs = 2'000'000'000;
// What the other camera sees of all that has moved since an onset, while it catches up: of cameras that are
// not triggered together, it sees half or more a frame later.
constexpr double kMostSeenSince = 0.4;
constexpr int kCatchUp = 2;  // frames
// Steps of the last second are compared with those up to that much earlier.
constexpr int64_t kFollowNs = 1'000'000'000, kLongestLagNs = 700'000'000;
constexpr int kLeastLag = 2;  // frames; cameras that are not triggered together differ by up to one
constexpr int kLeastFollowed = 5;
constexpr double kSameLagS = 0.05;    // of two grids of time; a frame of the slowest rate that is followed
constexpr float kLeastOverNoise = 2;  // of sums of squares
constexpr double kFollows = 0.8, kBetter = 0.15;  // correlations
// A step is over so long: over one frame at 30 Hz, two pictures that come twice are half of what moves for a
// while.
constexpr int64_t kStepOverNs = 100'000'000;
constexpr float kNearlyThere = 0.1F;  // of the time between two frames
// Of the variance of a marker that stands still, what is left in the median of three frames.
constexpr float kSteadyNoise = 0.45F;
constexpr int64_t kFarNs = 150'000'000;  // a steady motion is alike so much later, too

}  // namespace

// A moment between two frames.
struct CameraMotion::Moment {
  int newer_ago = 0;  // frames
  float older_share = 0;
};

// Moments of one distance, the newest first: where a machine skips frames, these come unevenly, and as many
// of them are no time.
struct CameraMotion::EvenTimes {
  int64_t step_ns = 0;
  std::vector<Moment> moments;

  int Count(int64_t time_ns) const { return static_cast<int>((time_ns + step_ns / 2) / step_ns); }
};

// How well the steps of one camera follow the other's, some time later.
struct CameraMotion::Shift {
  double lag_s = 0;  // of the top camera; negative: of the bottom camera
  bool is_far = false;
  double correlation = 0;
  // The same steps of either camera; or a picture that comes out of turn would be explained by leaving it
  // out.
  std::optional<double> at_once;  // none: too little moves

  bool IsFound() const { return correlation > kFollows && at_once && correlation > *at_once + kBetter; }
  bool IsRefuted() const { return at_once > kFollows && *at_once > correlation + kBetter; }
};

CameraMotion::CameraMotion(const LinkModel& model, const StereoRig& rig, double noise_px)
    : length_unit_(LengthUnit(model)), reader_(model, rig, noise_px), radii_(kRing), exposures_ns_(kRing) {
  for (MarkerRadii& radii : radii_) reader_.Forget(radii);
}

size_t CameraMotion::Place(int frames_ago) const {
  return (newest_ + kRing - static_cast<size_t>(frames_ago)) % kRing;
}

void CameraMotion::Take(int64_t now_ns, const LabelledMarkers& markers) {
  const int64_t passed_ns = now_ns - exposures_ns_[newest_];
  if (passed_ns <= 0 || passed_ns > kLongestNs) {
    frames_ = 0;
    suspect_.reset();
  }
  newest_ = (newest_ + 1) % kRing;
  frames_ = std::min(frames_ + 1, static_cast<int>(kRing));
  exposures_ns_[newest_] = now_ns;
  reader_.Read(markers, radii_[newest_]);
}

std::optional<SeenMotion> CameraMotion::CompareWith(int frames_ago, double most_seen) const {
  return CompareRadii(Radii(frames_ago), Radii(0), kLeastMovedMm * length_unit_, most_seen);
}

// Over the shortest time in which there was enough motion, for later both have moved; after that, since then.
std::optional<SeenMotion> CameraMotion::Onset() {
  std::optional<SeenMotion> moved;
  int ago = 1;
  for (; Has(ago) && AgoNs(ago) <= kOnsetNs; ++ago) {
    moved = CompareWith(ago, kMostSeen);
    if (moved) break;
  }
  // What one of them has only just caught up with, the other saw shortly before.
  if (moved && moved->alone && Has(ago + kCatchUp)) {
    const auto wider = CompareWith(ago + kCatchUp, kMostSeenSince);
    if (!wider || wider->alone != moved->alone) moved->alone.reset();
  }
  if (suspect_ && Has(ago)) {
    int since = ago;
    while (Has(since + 1) && AgoNs(since + 1) <= kOnsetNs && ExposureNs(since) > onset_ns_) ++since;
    const auto moved_since = CompareWith(since, kMostSeenSince);
    if (moved_since && moved_since->alone == suspect_) return moved_since;
  }
  if (moved) onset_ns_ = ExposureNs(ago);
  return moved;
}

// Rows of those that either camera has seen move lately.
std::vector<Eigen::Index> CameraMotion::MovedLately() const {
  std::vector<Eigen::Index> moved;
  const MarkerRadii& now = Radii(0);
  for (Eigen::Index m = 0; m < now.variances_mm2.size(); ++m) {
    const float least_mm2 = 2 * kMovedDeviations * kMovedDeviations * now.variances_mm2(m);
    for (const int ago : {1, 2, 4, 7, 11, 16, 22, 29}) {
      if (!Has(ago)) break;
      const auto way_mm = [&](size_t camera) { return now.mm[camera](m) - Radii(ago).mm[camera](m); };
      if (!(std::pow(way_mm(0), 2) > least_mm2 || std::pow(way_mm(1), 2) > least_mm2)) continue;
      moved.push_back(m);
      break;
    }
  }
  return moved;
}

// Of three frames in a row, so that a single picture that is shown again, or comes out of turn, tells nothing
// of a lag: what it shows, the other camera may as well have shown, by such a picture of its own, at another
// time.
float CameraMotion::SteadyMm(size_t camera, const Moment& moment, Eigen::Index marker) const {
  const auto steady_mm = [&](int ago) {
    const auto radius_mm = [&](int frame) { return Radii(frame).mm[camera](marker); };
    const float before = radius_mm(ago + 1), now = radius_mm(ago), after = radius_mm(ago - 1);
    if (std::isnan(before + now + after)) return std::numeric_limits<float>::quiet_NaN();
    return std::max(std::min(before, after), std::min(std::max(before, after), now));
  };
  const float newer_mm = steady_mm(moment.newer_ago);
  if (moment.older_share == 0) return newer_mm;
  return newer_mm + moment.older_share * (steady_mm(moment.newer_ago + 1) - newer_mm);
}

// From the second newest frame to the second oldest that is needed, for SteadyMm asks both neighbors.
CameraMotion::EvenTimes CameraMotion::Times() const {
  int last = 1;
  while (Has(last + 2) && AgoNs(last) - AgoNs(1) < kFollowNs + kLongestLagNs + kStepOverNs) ++last;
  EvenTimes times;
  if (!Has(last + 1) || last < 2) return times;
  std::vector<int64_t> gaps_ns;
  for (int ago = 1; ago < last; ++ago) gaps_ns.push_back(AgoNs(ago + 1) - AgoNs(ago));
  const auto middle = gaps_ns.begin() + (last - 1) / 2;
  std::ranges::nth_element(gaps_ns, middle);
  const int64_t span_ns = AgoNs(last) - AgoNs(1),
                steps = std::max<int64_t>(1, (span_ns + *middle / 2) / *middle);
  times.step_ns = span_ns / steps;
  int ago = 1;
  for (int64_t i = 0; i <= steps; ++i) {
    const int64_t at_ns = AgoNs(1) + i * span_ns / steps;
    while (ago + 1 < last && AgoNs(ago + 1) <= at_ns) ++ago;
    const auto gap_ns = static_cast<float>(AgoNs(ago + 1) - AgoNs(ago));
    const float share = static_cast<float>(at_ns - AgoNs(ago)) / gap_ns;
    // Clocks jitter: a moment that is nearly a frame's is that frame's, or it would ask for one more to be
    // seen.
    if (share < kNearlyThere)
      times.moments.push_back({ago, 0});
    else if (share > 1 - kNearlyThere)
      times.moments.push_back({ago + 1, 0});
    else
      times.moments.push_back({ago, share});
  }
  return times;
}

// Of some markers, the newest step in column 0; 0 where either camera does not see it.
struct CameraMotion::Steps {
  std::array<Eigen::MatrixXf, kCameraCount> mm;
  Eigen::VectorXf noise_mm2;  // of a column
  std::array<Eigen::VectorXf, kCameraCount> squares_mm2;
  Eigen::MatrixXf products_mm2;  // the top camera's steps by the bottom camera's

  std::optional<double> Correlation(int top_ago, int bottom_ago, int n, float least_mm2) const;
  std::optional<double> AtOnce(int ago, int n, float least_mm2) const;
};

CameraMotion::Steps CameraMotion::StepsOf(const std::vector<Eigen::Index>& markers, const EvenTimes& times,
                                          int step) const {
  const int places = static_cast<int>(times.moments.size()), count = places - step;
  Steps steps;
  steps.noise_mm2.setZero(count);
  for (auto& mm : steps.mm) mm.setZero(static_cast<Eigen::Index>(markers.size()), count);
  std::array<Eigen::VectorXf, kCameraCount> mm = {Eigen::VectorXf(places), Eigen::VectorXf(places)};
  for (size_t i = 0; i < markers.size(); ++i) {
    const Eigen::Index m = markers[i];
    for (size_t c = 0; c < kCameraCount; ++c)
      for (int t = 0; t < places; ++t) mm[c](t) = SteadyMm(c, times.moments[static_cast<size_t>(t)], m);
    for (int t = 0; t < count; ++t) {
      const std::array<float, kCameraCount> step_mm = {mm[0](t) - mm[0](t + step),
                                                       mm[1](t) - mm[1](t + step)};
      if (std::isnan(step_mm[0] + step_mm[1])) continue;
      for (size_t c = 0; c < kCameraCount; ++c) steps.mm[c](static_cast<Eigen::Index>(i), t) = step_mm[c];
      for (const int end : {t, t + step}) {
        // Medians of neighboring frames share two of three frames: less than half of it is averaged out.
        const Moment& moment = times.moments[static_cast<size_t>(end)];
        const float averaged = 1 - 0.8F * moment.older_share * (1 - moment.older_share);
        steps.noise_mm2(t) += averaged * kSteadyNoise * Radii(moment.newer_ago).variances_mm2(m);
      }
    }
  }
  for (size_t c = 0; c < kCameraCount; ++c) steps.squares_mm2[c] = steps.mm[c].colwise().squaredNorm();
  steps.products_mm2 = steps.mm[0].transpose() * steps.mm[1];
  return steps;
}

// With S(t) the steps of all markers t frames ago, the correlation of n steps of the top camera, the newest
// of which is `top_ago`, with as many of the bottom camera is sum S_top(t) . S_bottom(t + lag) by the root of
// both sums of squares, which are taken less their noise. None: too little moves.
std::optional<double> CameraMotion::Steps::Correlation(int top_ago, int bottom_ago, int n,
                                                       float least_mm2) const {
  const float top_noise = noise_mm2.segment(top_ago, n).sum(),
              bottom_noise = noise_mm2.segment(bottom_ago, n).sum();
  const float top = squares_mm2[0].segment(top_ago, n).sum() - top_noise,
              bottom = squares_mm2[1].segment(bottom_ago, n).sum() - bottom_noise;
  if (top < std::max(least_mm2, kLeastOverNoise * top_noise) ||
      bottom < std::max(least_mm2, kLeastOverNoise * bottom_noise))
    return {};
  const double both =
      products_mm2.diagonal(bottom_ago - top_ago).segment(std::min(top_ago, bottom_ago), n).sum();
  return both / std::sqrt(top * bottom);
}

// The largest, for cameras that are not triggered together differ by up to one frame.
std::optional<double> CameraMotion::Steps::AtOnce(int ago, int n, float least_mm2) const {
  std::optional<double> most;
  for (int lag = 1 - kLeastLag; lag < kLeastLag; ++lag) {
    const auto correlation =
        Correlation(ago + std::max(0, -lag), ago + std::max(0, lag), n - std::abs(lag), least_mm2);
    if (correlation) most = std::max(most.value_or(0), *correlation);
  }
  return most;
}

std::vector<CameraMotion::Shift> CameraMotion::Follow() const {
  const EvenTimes times = Times();
  if (times.moments.empty()) return {};
  const int step = std::max(1, times.Count(kStepOverNs)), longest_lag = times.Count(kLongestLagNs);
  const int places = static_cast<int>(times.moments.size()), count = places - step;
  // Of frames, the newest of which is no moment.
  const int window = std::min(places + 1, times.Count(kFollowNs));
  const auto moved = MovedLately();
  if (moved.size() < kLeastMoved || count < kLeastFollowed) return {};
  const Steps steps = StepsOf(moved, times, step);
  const float least_mm2 = kLeastMoved * static_cast<float>(std::pow(kLeastMovedMm * length_unit_, 2));
  std::vector<Shift> shifts;
  for (int lag = -longest_lag; lag <= longest_lag; ++lag) {
    if (std::abs(lag) < kLeastLag) continue;
    const int later = std::max(0, -lag), earlier = std::max(0, lag);
    const int n = std::min(window, count - std::abs(lag));
    if (n < std::max(kLeastFollowed, window / 2)) continue;
    const auto correlation = steps.Correlation(later, earlier, n, least_mm2);
    if (!correlation) continue;
    const auto at_once = std::max(steps.AtOnce(later, n, least_mm2), steps.AtOnce(earlier, n, least_mm2));
    const int64_t lag_ns = lag * times.step_ns;
    shifts.push_back({1e-9 * static_cast<double>(lag_ns), std::abs(lag_ns) >= kFarNs, *correlation, at_once});
  }
  return shifts;
}

// What was told is taken back by a motion that it does not explain; a lag of a few frames, which explains any
// slow motion nearly as well as none does, by one in which both are together.
void CameraMotion::TakeLag(const std::vector<Shift>& shifts) {
  auto found = std::views::filter(shifts, &Shift::IsFound);
  if (const auto best = std::ranges::max_element(found, {}, &Shift::correlation); best != found.end()) {
    lag_s_ = best->lag_s;
  } else if (lag_s_) {
    const auto nearest = std::ranges::min_element(
        shifts, {}, [&](const Shift& shift) { return std::abs(shift.lag_s - *lag_s_); });
    const bool is_refuted =
        nearest != shifts.end() && nearest->IsRefuted() && std::abs(nearest->lag_s - *lag_s_) < kSameLagS;
    if (is_refuted || AreTogether(shifts)) lag_s_.reset();
  }
}

// At once is better than at any lag that can be told from none in a steady motion, too.
bool CameraMotion::AreTogether(const std::vector<Shift>& shifts) {
  auto far = std::views::filter(shifts, &Shift::is_far);
  return !far.empty() && std::ranges::all_of(far, &Shift::IsRefuted);
}

bool CameraMotion::IsHeld(int64_t now_ns) const {
  return held_until_ns_ && now_ns <= *held_until_ns_ && now_ns >= *held_until_ns_ - kHoldNs;
}

void CameraMotion::Observe(const FrameTimes& times, const LabelledMarkers& markers) {
  const int64_t now_ns = times.exposure_monotonic_ns;
  const int64_t passed_ns = now_ns - exposures_ns_[newest_];
  if (frames_ > 0 && passed_ns > 0 && passed_ns < kStepNs) return;
  Take(now_ns, markers);
  const auto shifts = Follow();
  TakeLag(shifts);
  const bool was_held = alone_ && IsHeld(now_ns);
  if (const auto moved = Onset()) {
    // Cameras that are not triggered together expose up to half a frame apart, in which a quick touch may
    // begin: only what the other camera does not see in a later frame either is held against it. A motion
    // that goes on shows nothing new, but that the other is still behind.
    if ((moved->alone && moved->alone == suspect_) || (was_held && !AreTogether(shifts)))
      held_until_ns_ = now_ns + kHoldNs;
    suspect_ = moved->alone;
    suspect_ns_ = now_ns;
  }
  if (now_ns < suspect_ns_ || now_ns > suspect_ns_ + kOnsetNs) suspect_.reset();
  if (suspect_)
    alone_ = suspect_;
  else if (!IsHeld(now_ns))
    alone_.reset();
}

std::optional<MotionDisagreement> CameraMotion::disagreement() const {
  if (lag_s_) return MotionDisagreement{*lag_s_ > 0 ? CameraId::kTop : CameraId::kBottom, std::abs(*lag_s_)};
  return alone_ ? std::optional(MotionDisagreement{*alone_}) : std::nullopt;
}

}  // namespace taclink
