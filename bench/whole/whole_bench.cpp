#include "bench/whole/whole_bench.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

#include "bench/tools/thread_clock.h"
#include "bench/whole/whole_pictures.h"
#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/link_pipeline.h"

namespace taclink {
namespace {

constexpr double kForceN = 0.03, kRightShare = 0.1, kSilentShare = 0.15, kDeviations = 3;
constexpr double kMostHiddenN = 0.1, kMostHiddenAroundN = 0.5;  // whatever a frame says of its limits
constexpr double kCenterMm = 4, kFarMm = 12, kPhantomMm = 25;
constexpr size_t kMostOfSkin = 10;  // scenes that one worker plays

// What presses as one, and what was found of it.
struct Body {
  Vec3 true_n = Vec3::Zero(), found_n = Vec3::Zero();
  Vec3 true_center_mm = Vec3::Zero(), found_center_mm = Vec3::Zero();  // sums by normal force
  double true_weight = 0, found_weight = 0;
  Mat3 covariance_n2 = Mat3::Zero();

  void Add(const Contact& contact) {
    found_n += contact.force_n;
    found_center_mm += contact.normal_force_n * contact.center_mm;
    found_weight += contact.normal_force_n;
    covariance_n2 += contact.force_covariance_n2.value_or(Mat3::Zero());
  }
  double Sigma() const { return std::sqrt(covariance_n2.trace()); }
};

class Scorer {
 public:
  Scorer(const LinkModel& model, const WholeScene& scene, const SkinTruth& truth, const LinkState& state)
      : model_(model),
        length_(LengthUnit(model)),
        force_(ForceUnit(model)),
        scene_(scene),
        truth_(truth),
        state_(state) {
    frame_.is_right = true;
  }

  WholeFrame Score() {
    for (const TrueContact& contact : truth_.contacts) {
      if (bodies_.empty() || !scene_.is_one_body) bodies_.emplace_back();
      Body& body = bodies_.back();
      const double n = contact.force_n.norm();
      body.true_n += contact.force_n;
      body.true_center_mm += n * contact.center_mm;
      body.true_weight += n;
    }
    for (const Contact& contact : state_.contacts) {
      if (Body* body = BodyAt(contact)) {
        body->Add(contact);
        continue;
      }
      frame_.off_n += contact.force_n.norm();
      CheckForce("phantom", contact.force_n, 0,
                 std::sqrt(contact.force_covariance_n2.value_or(Mat3::Zero()).trace()));
    }
    for (const Body& body : bodies_) {
      const Vec3 off = body.found_n - body.true_n;
      // What is not found may press as much as the frame says that it may not find there.
      const double limit_n = LimitAt(body);
      const bool is_hidden = body.found_weight <= 0 && body.true_weight <= limit_n;
      const double most_n = (scene_.is_one_body ? kMostHiddenAroundN : kMostHiddenN) * force_;
      const double hidden_n = is_hidden ? std::min(limit_n, most_n) : 0;
      CheckForce("force", off, body.true_n.norm(), body.Sigma(), hidden_n);
      if (limit_n > 0 && body.true_weight > limit_n) {
        ++frame_.above_limit;
        frame_.found_above_limit += body.found_weight > 0 ? 1 : 0;
      }
      if (scene_.is_one_body)
        CheckForce("pressing", Vec3(body.found_weight - body.true_weight, 0, 0), body.true_weight,
                   body.Sigma(), hidden_n);
      // Of what presses from all sides the forces cancel out.
      frame_.true_n += scene_.is_one_body ? body.true_weight : body.true_n.norm();
      frame_.off_n += scene_.is_one_body ? std::abs(body.found_weight - body.true_weight) : off.norm();
      ++frame_.bodies;
      frame_.within_2_sigma += off.norm() <= 2 * body.Sigma() ? 1 : 0;
      CheckCenter(body);
    }
    return std::move(frame_);
  }

 private:
  // Of the disc whose edge is nearest.
  Body* BodyAt(const Contact& contact) {
    Body* nearest = nullptr;
    double least = kPhantomMm * length_;
    for (size_t i = 0; i < truth_.contacts.size(); ++i) {
      const TrueContact& disc = truth_.contacts[i];
      const double away = contact.is_ring_contact
                              ? std::abs(contact.center_mm.z() - disc.center_mm.z())
                              : (contact.center_mm - disc.center_mm).norm() - disc.patch_diameter_mm / 2;
      if (away < least) least = away, nearest = &bodies_[scene_.is_one_body ? 0 : i];
    }
    return nearest;
  }
  // Of one body, at the marker nearest to it; of those that press as one, if they do all around. 0: none is
  // told.
  double LimitAt(const Body& body) const {
    if (body.true_weight <= 0 || state_.forces.limits_n.empty()) return 0;
    if (scene_.is_one_body) return scene_.is_around ? state_.forces.limit_around_n : 0;
    const Vec3 center_mm = body.true_center_mm / body.true_weight;
    int nearest = 0;
    for (int m = 1; m < model_.markers.count(); ++m) {
      if ((model_.RestMarker(m) - center_mm).norm() < (model_.RestMarker(nearest) - center_mm).norm())
        nearest = m;
    }
    return state_.forces.limits_n[static_cast<size_t>(nearest)];
  }
  void CheckForce(const char* what, const Vec3& off, double true_n, double sigma_n, double hidden_n = 0) {
    const double error = off.norm(), least = kForceN * force_;
    if (error > std::max(least, kRightShare * true_n)) frame_.is_right = false;
    if (error <= std::max({least, kSilentShare * true_n, kDeviations * sigma_n, hidden_n})) return;
    char text[120];
    std::snprintf(text, sizeof text, "%s off by %.3f of %.3f N, sigma %.3f", what, error, true_n, sigma_n);
    Tell(text);
  }
  void Tell(const std::string& what) {
    frame_.how += (frame_.how.empty() ? "" : "; ") + what;
    frame_.is_silent = state_.status == LinkStatus::kOk;
  }
  // A center of what is all around is on the axis.
  void CheckCenter(const Body& body) {
    if (body.found_weight <= 0 || scene_.is_one_body) return;
    const double away =
        (body.found_center_mm / body.found_weight - body.true_center_mm / body.true_weight).norm();
    if (body.true_n.norm() < kForceN * force_) return;
    if (away > kCenterMm * length_) frame_.is_right = false;
    if (away > kFarMm * length_) Tell("center off by " + std::to_string(std::lround(away)) + " mm");
  }

  const LinkModel& model_;
  const double length_, force_;
  const WholeScene& scene_;
  const SkinTruth& truth_;
  const LinkState& state_;
  std::vector<Body> bodies_;
  WholeFrame frame_;
};

PipelineOptions OptionsFor(const LinkModel& model, const WholeScene& scene, const ForceMethod& method) {
  const LinkFault& fault = scene.fault;
  PipelineOptions options;
  options.force.model = method.model;
  options.force.refinement = method.refinement;
  if (fault.follows_drift) options.drift = DriftOptions{};
  if (!fault.is_calibrated) return options;
  CameraEffects effects = scene.scene.camera;
  effects.mount[Index(CameraId::kTop)].shift_mm += fault.calibration_off.shift_mm;
  effects.mount[Index(CameraId::kTop)].turn_rad += fault.calibration_off.turn_rad;
  options.rig = MountedRig(model.nominal_rig, effects);
  return options;
}

WholeFrame ScoreWhole(const LinkModel& model, const WholeScene& scene, const SkinTruth& truth,
                      const std::vector<Vec3>& baseline_mm, const LinkState& state) {
  WholeFrame frame = Scorer(model, scene, truth, state).Score();
  frame.time_s = truth.time_s;
  frame.status = state.status;
  frame.status_reason = state.status_reason;
  for (const Reason& reason : state.reasons) frame.reasons.push_back(reason.id);
  frame.has_forces = state.measured() && state.forces.converged && state.status != LinkStatus::kLost;
  if (!state.measured())
    frame.bodies = frame.within_2_sigma = frame.above_limit = frame.found_above_limit = 0;
  for (size_t m = 0; m < state.shape.displacements_mm.size() && m < baseline_mm.size(); ++m) {
    const Vec3 moved = truth.marker_mm[m] - baseline_mm[m];
    frame.worst_marker_mm = std::max(frame.worst_marker_mm, (state.shape.displacements_mm[m] - moved).norm());
  }
  return frame;
}

const LinkModel& Named(const std::vector<LinkModel>& models, const std::string& name) {
  return *std::find_if(models.begin(), models.end(), [&](const LinkModel& m) { return m.name == name; });
}

WholeOutcome Play(const std::vector<LinkModel>& models, const WholeScene& scene, const ForceMethod& method,
                  SimulatedSkin& skin, SimulatedSkin* other) {
  const LinkModel& model = Named(models, scene.model);
  WholePictures pictures(model, scene, skin, other);
  LinkModel known =
      scene.fault.configured_model.empty() ? model : Named(models, scene.fault.configured_model);
  known.material.youngs_modulus_mpa *= scene.fault.modulus_factor;
  LinkPipeline link(known, OptionsFor(model, scene, method), ThreadCpuClock());
  StereoFrame frame;
  SkinTruth truth;
  LinkState state;
  std::vector<Vec3> baseline_mm;
  WholeOutcome outcome{.scene = &scene, .method = method, .frames = {}, .refusal = {}, .failure = {}};
  bool is_tare_due = scene.fault.tare_s >= 0;
  for (int i = 0; i < scene.frames; ++i) {
    pictures.Take(i, frame, truth);
    if (is_tare_due && truth.time_s >= scene.fault.tare_s) {
      static_cast<void>(link.BeginTare({}));
      is_tare_due = false;
    }
    const int64_t begin_ns = ThreadCpuClock().MonotonicNs();
    link.Process(frame, state);
    const int64_t end_ns = ThreadCpuClock().MonotonicNs();
    if (state.status == LinkStatus::kCalibrating) {
      outcome.refusal = state.status_reason;
      baseline_mm = truth.marker_mm;
    }
    outcome.frames.push_back(ScoreWhole(model, scene, truth, baseline_mm, state));
    outcome.frames.back().cpu_ms = 1e-6 * static_cast<double>(end_ns - begin_ns);
    if (const auto tared = link.TakeTareEnd(); tared && *tared) baseline_mm = truth.marker_mm;
  }
  return outcome;
}

using Scenes = std::vector<size_t>;

// Scenes of the same skin, which takes longer to solve than some pictures of it.
std::vector<Scenes> BySkin(const std::vector<WholeScene>& scenes) {
  std::vector<Scenes> groups;
  std::map<std::string, size_t> places;
  for (size_t i = 0; i < scenes.size(); ++i) {
    const auto [at, is_new] = places.emplace(SkinKey(scenes[i]), groups.size());
    if (!is_new && groups[at->second].size() == kMostOfSkin) at->second = groups.size();
    if (at->second == groups.size()) groups.emplace_back();
    groups[at->second].push_back(i);
  }
  return groups;
}

// Plays scenes of one skin, of each all methods.
void PlayGroup(const std::vector<LinkModel>& models, const std::vector<WholeScene>& scenes,
               const Scenes& group, const std::vector<ForceMethod>& methods,
               const std::function<void(size_t, WholeOutcome)>& done) {
  const WholeScene& first = scenes[group.front()];
  const LinkModel& model = Named(models, first.model);
  const auto skin = SimulatedSkin::Make(model, first.scene);
  std::optional<Result<std::unique_ptr<SimulatedSkin>>> other;
  for (const size_t i : group) {
    const WholeScene& scene = scenes[i];
    if (scene.fault.pictures == PictureFault::kCrossed && !other)
      other = SimulatedSkin::Make(model, OtherLinksScene(scene));
    for (size_t m = 0; m < methods.size(); ++m) {
      WholeOutcome outcome{.scene = &scene, .method = methods[m], .frames = {}, .refusal = {}, .failure = {}};
      if (!skin || (other && !*other))
        outcome.failure = (skin ? *other : skin).error().message;
      else
        outcome = Play(models, scene, methods[m], **skin, other ? (*other)->get() : nullptr);
      done(i * methods.size() + m, std::move(outcome));
    }
  }
}

}  // namespace

std::vector<WholeOutcome> RunWholeBench(const std::vector<LinkModel>& models,
                                        const std::vector<WholeScene>& scenes, const WholeOptions& options) {
  cv::setNumThreads(1);
  const std::vector<Scenes> groups = BySkin(scenes);
  std::vector<WholeOutcome> outcomes(scenes.size() * options.methods.size());
  std::mutex mutex;  // guards what is told
  std::atomic<size_t> next = 0;
  const auto take = [&](size_t place, WholeOutcome outcome) {
    outcomes[place] = std::move(outcome);
    const std::lock_guard lock(mutex);
    if (options.done) options.done(outcomes[place]);
  };
  const auto work = [&] {
    for (size_t i = next++; i < groups.size(); i = next++)
      PlayGroup(models, scenes, groups[i], options.methods, take);
  };
  std::vector<std::thread> workers;
  for (int i = 1; i < options.jobs; ++i) workers.emplace_back(work);
  work();
  for (std::thread& worker : workers) worker.join();
  return outcomes;
}

}  // namespace taclink
