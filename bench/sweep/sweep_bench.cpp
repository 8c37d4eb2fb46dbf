#include "bench/sweep/sweep_bench.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <opencv2/core.hpp>
#include <random>
#include <thread>
#include <utility>

#include "bench/played/played_link.h"
#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

constexpr double kRateHz = 10, kRestS = 1.2, kInflateS = 1, kInflatedS = 1.6;
// Times within one contact, s: its duration, its ramp, and the interval whose frames are averaged.
constexpr double kEachS = 1, kRampS = 0.2, kReadFromS = 0.45, kReadToS = 0.65;
constexpr std::array kDepthsMm = {1.0, 2.5, 4.0};
constexpr double kDiscMm = 11, kNearMm = 25, kJitterPx = 0.15, kMountMm = 0.3, kMountRad = 0.005;

Scene Still(double kpa, double duration_s) {
  Scene scene;
  scene.name = "sweep";
  scene.frame_rate_hz = kRateHz;
  scene.duration_s = duration_s;
  scene.loop = false;
  scene.pressure = {{0, kpa}};
  return scene;
}

PlayedLink MakeLink(const LinkModel& model, const SweepUnit& unit) {
  const auto seed = static_cast<uint64_t>(unit.path + 1000 * std::lround(10 * unit.pressure_kpa));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  CameraEffects effects;
  effects.marker_jitter_px = kJitterPx;
  for (MountError& mount : effects.mount) {
    mount.shift_mm = kMountMm * Vec3(normal(random), normal(random), normal(random));
    mount.turn_rad = kMountRad * Vec3(normal(random), normal(random), normal(random));
  }
  return PlayedLink({.model = model, .effects = effects, .known = model, .seed = seed});
}

/// Mean over the frames of one disc.
class Answer {
 public:
  void Add(const SkinTruth& truth, const LinkState& state, double near_mm) {
    if (truth.contacts.empty()) return;
    const TrueContact& disc = truth.contacts.front();
    ++frames_;
    true_n_ += disc.force_n;
    true_center_mm_ += disc.center_mm;
    limited_ = limited_ || disc.limited;
    is_ok_ = is_ok_ && state.status == LinkStatus::kOk;
    if (state.status != LinkStatus::kOk) NoteReasons(state);
    if (!state.has_forces()) return;
    ++answered_;
    for (const Contact& contact : state.contacts) {
      if ((contact.center_mm - disc.center_mm).norm() > near_mm) {
        phantom_n_ += contact.force_n.norm();
        far_n_ += contact.force_n;
        continue;
      }
      found_n_ += contact.force_n;
      weight_n_ += contact.normal_force_n;
      center_mm_ += contact.normal_force_n * contact.center_mm;
    }
  }

  void Tell(SweepContact& out) const {
    const double frames = std::max(1, frames_);
    const Vec3 true_n = true_n_ / frames;
    out.true_n = true_n.norm();
    out.is_limited = limited_;
    out.has_forces = frames_ > 0 && answered_ == frames_;
    out.is_ok = out.has_forces && is_ok_;
    out.reasons = reasons_;
    if (!out.has_forces) return;
    const Vec3 found_n = found_n_ / frames;
    out.found_n = found_n.norm();
    out.force_error_n = (found_n - true_n).norm();
    out.phantom_n = phantom_n_ / frames;
    out.balance_n = (found_n + far_n_ / frames - true_n).norm();
    if (weight_n_ > 0) out.center_error_mm = (center_mm_ / weight_n_ - true_center_mm_ / frames).norm();
  }

 private:
  void NoteReasons(const LinkState& state) {
    for (const Reason& reason : state.reasons) {
      if (reasons_.find(Name(reason.id)) != std::string::npos) continue;
      reasons_ += (reasons_.empty() ? "" : " ") + std::string(Name(reason.id));
    }
  }

  int frames_ = 0, answered_ = 0;
  bool limited_ = false, is_ok_ = true;
  Vec3 true_n_ = Vec3::Zero(), true_center_mm_ = Vec3::Zero(), found_n_ = Vec3::Zero(), far_n_ = Vec3::Zero(),
       center_mm_ = Vec3::Zero();
  double weight_n_ = 0, phantom_n_ = 0;
  std::string reasons_;
};

/// One link, and the contacts of its unit.
class SweptLink {
 public:
  SweptLink(const LinkModel& model, const SweepUnit& unit)
      : model_(model), unit_(unit), link_(MakeLink(model, unit)) {}

  // After a failure the contacts so far are kept.
  Result<void> Sweep() {
    if (auto rested = link_.Play(Still(0, kRestS)); !rested) return rested;
    if (unit_.pressure_kpa > 0) {
      Scene inflation = Still(unit_.pressure_kpa, kInflatedS);
      inflation.pressure = {{0, 0}, {kInflateS, unit_.pressure_kpa}};
      if (auto inflated = link_.Play(inflation); !inflated) return inflated;
    }
    for (int ring = 1; ring <= model_.markers.rings(); ++ring) {
      for (const bool is_cell : {false, true}) {
        if (is_cell && ring == model_.markers.rings()) continue;
        if (auto pressed = Press(ring, is_cell); !pressed) return pressed;
      }
    }
    return {};
  }

  const std::vector<SweepContact>& contacts() const { return contacts_; }

 private:
  Result<void> Press(int ring, bool is_cell) {
    const auto& rings_mm = model_.markers.rings_z_mm;
    const auto i = static_cast<size_t>(ring - 1);
    SkinPlace at;
    at.angle_rad = model_.PathAngle(unit_.path - 1) + (is_cell ? model_.markers.path_pitch_rad() / 2 : 0);
    at.z_mm = is_cell ? (rings_mm[i] + rings_mm[i + 1]) / 2 : rings_mm[i];
    const double unit = LengthUnit(model_);
    Scene scene = Still(unit_.pressure_kpa, kEachS * static_cast<double>(kDepthsMm.size()));
    for (size_t k = 0; k < kDepthsMm.size(); ++k) {
      SceneContact& contact = scene.contacts.emplace_back();
      contact.at = at;
      contact.patch_diameter_mm = kDiscMm * unit;
      contact.depth_mm = kDepthsMm[k] * unit;
      contact.begin_s = kEachS * static_cast<double>(k) + 0.05;
      contact.end_s = kEachS * static_cast<double>(k + 1) - 0.05;
      contact.ramp_s = kRampS;
      contact.where = "sweep";
    }
    std::array<Answer, kDepthsMm.size()> answers;
    auto played = link_.Play(scene, [&](const SkinTruth& truth, const LinkState& state) {
      const double within_s = std::fmod(truth.time_s + 1e-6, kEachS);
      if (within_s < kReadFromS || within_s > kReadToS) return;
      answers[static_cast<size_t>((truth.time_s + 1e-6) / kEachS)].Add(truth, state, kNearMm * unit);
    });
    if (!played) return played;
    for (size_t k = 0; k < kDepthsMm.size(); ++k) {
      SweepContact contact{.unit = unit_, .ring = ring, .is_cell = is_cell, .depth_mm = kDepthsMm[k] * unit};
      answers[k].Tell(contact);
      contacts_.push_back(std::move(contact));
    }
    return {};
  }

  const LinkModel& model_;
  const SweepUnit unit_;
  PlayedLink link_;
  std::vector<SweepContact> contacts_;
};

}  // namespace

size_t SweepContactsOfUnit(const LinkModel& model) {
  return kDepthsMm.size() * static_cast<size_t>(2 * model.markers.rings() - 1);
}

std::vector<SweepUnit> SweepUnits(const std::vector<LinkModel>& models,
                                  const std::vector<double>& pressures_kpa) {
  std::vector<SweepUnit> units;
  for (const int first : {1, 5, 3, 7, 2, 6, 4, 8}) {
    for (const LinkModel& model : models) {
      for (const double kpa : pressures_kpa) {
        for (int path = first; path <= model.markers.paths; path += 8)
          units.push_back({.model = model.name, .pressure_kpa = kpa, .path = path});
      }
    }
  }
  return units;
}

void RunSweep(const std::vector<LinkModel>& models, const SweepOptions& options) {
  cv::setNumThreads(1);
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  const auto work = [&] {
    for (size_t i = next++; i < options.units.size(); i = next++) {
      const SweepUnit& unit = options.units[i];
      SweptLink link(*std::ranges::find(models, unit.model, &LinkModel::name), unit);
      const auto swept = link.Sweep();
      const std::lock_guard lock(mutex);
      options.done(link.contacts(), swept ? std::string() : swept.error().message);
    }
  };
  std::vector<std::thread> workers;
  for (int i = 1; i < options.jobs; ++i) workers.emplace_back(work);
  work();
  for (std::thread& worker : workers) worker.join();
}

}  // namespace taclink
