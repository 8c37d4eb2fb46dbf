#include "bench/vision/scene_generator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "sensing/simulation/random.h"

namespace taclink {
namespace {

constexpr std::array<const char*, kSceneCategoryCount> kNames = {
    "rest",     "inflation", "one-dent",  "two-dents",  "three-dents", "plate",
    "pinch",    "ring",      "fast-push", "fast-slide", "clean",       "noise",
    "exposure", "flicker",   "defocus",   "dirt",       "misaligned",  "mixed"};

constexpr double kRateHz = 30;
constexpr double kBeginS = (kRestFrames + 1) / kRateHz;
constexpr double kDeepestMm = 15;
constexpr double kFastMmPerS = 30;
constexpr double kHoldS = 0.2;
constexpr double kJitterPx = 0.3;
constexpr double kSteepest = 0.6;  // depth over the distance to the clamped end: silicone stretches no more
constexpr double kPatchMm = 8;

class Generator {
 public:
  Generator(const LinkModel& model, SceneCategory category, int number, uint64_t seed)
      : model_(model), category_(category) {
    uint64_t bits = MixBits(seed);
    for (const char c : model.name) bits = MixBits(bits + static_cast<uint64_t>(c));
    bits = MixBits(bits + static_cast<uint64_t>(category) * 4096 + static_cast<uint64_t>(number));
    rng_.seed(bits);
    result_.name = std::string(Name(category)) + "-" + model.name + "-" + std::to_string(number);
    result_.category = category;
    result_.model = model.name;
    Scene& scene = result_.scene;
    scene.name = result_.name;
    scene.model = model.name;
    scene.skin = SkinKind::kLinear;  // hundreds of scenes share its responses
    scene.frame_rate_hz = kRateHz;
    scene.loop = false;
    scene.seed = bits >> 12;
    scene.pressure = {{0, 0}};
    scene.camera.marker_jitter_px = category == SceneCategory::kClean ? 0 : kJitterPx;
  }

  EvaluationScene Make() {
    Disturb();
    Touch();
    Scene& scene = result_.scene;
    const double rest_s = (kRestFrames + 20) / kRateHz;
    double end_s = scene.contacts.empty() ? rest_s : 0;
    for (const SceneContact& contact : scene.contacts) end_s = std::max(end_s, contact.end_s);
    end_s = std::max(end_s, scene.pressure.back().time_s);
    scene.duration_s = end_s + 3 / kRateHz;
    result_.frames = static_cast<int>(std::floor(scene.duration_s * kRateHz));
    return result_;
  }

 private:
  double Uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(rng_); }
  double LogUniform(double low, double high) { return std::exp(Uniform(std::log(low), std::log(high))); }
  bool Chance(double share) { return Uniform(0, 1) < share; }
  int Integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(rng_); }

  // On a marker, or anywhere between the clamped ends.
  SkinPlace AnyPlace() {
    const double margin = 9;
    if (Chance(0.4))
      return {.path = Integer(1, model_.markers.paths), .ring = Integer(1, model_.markers.rings())};
    return {.angle_rad = Uniform(-kPi, kPi), .z_mm = Uniform(margin, model_.length_mm - margin)};
  }
  double ZOf(const SkinPlace& place) const {
    return place.path > 0 ? model_.markers.rings_z_mm[static_cast<size_t>(place.ring - 1)] : place.z_mm;
  }
  double AngleOf(const SkinPlace& place) const {
    return place.path > 0 ? model_.PathAngle(place.path - 1) : place.angle_rad;
  }
  double MostDepth(double z_mm) const {
    return std::min(kDeepestMm, kSteepest * std::min(z_mm, model_.length_mm - z_mm));
  }
  double AnyDepth(double z_mm, double least_share = 0.3) { return MostDepth(z_mm) * Uniform(least_share, 1); }

  // Down and up again at `speed`, on average over the way.
  SceneContact Dent(const SkinPlace& at, double depth_mm, double speed_mm_per_s,
                    double patch_mm = kPatchMm) const {
    SceneContact contact;
    contact.at = at;
    contact.patch_diameter_mm = patch_mm;
    contact.depth_mm = depth_mm;
    contact.ramp_s = std::max(2 / kRateHz, depth_mm / speed_mm_per_s);
    contact.begin_s = begin_s_;
    contact.end_s = begin_s_ + 2 * contact.ramp_s + kHoldS;
    contact.where = result_.name;
    return contact;
  }
  double CalmSpeed() { return Uniform(12, 25); }

  void Pressurise(double kpa) {
    const double rise_s = 0.4 * std::max(1.0, kpa);
    result_.scene.pressure = {{kBeginS, 0}, {kBeginS + rise_s, kpa}};
    begin_s_ = kBeginS + 0.6 * rise_s;
  }

  void Dents(int count) {
    if (Chance(0.35)) Pressurise(Uniform(0.3, 1.5));
    std::vector<SkinPlace> places;
    for (int tries = 0; static_cast<int>(places.size()) < count && tries < 200; ++tries) {
      const SkinPlace place = AnyPlace();
      const bool apart = std::all_of(places.begin(), places.end(), [&](const SkinPlace& other) {
        const double turn = std::remainder(AngleOf(place) - AngleOf(other), 2 * kPi);
        return std::hypot(turn * model_.profile.Radius(ZOf(place)), ZOf(place) - ZOf(other)) > 22;
      });
      if (apart) places.push_back(place);
    }
    for (const SkinPlace& place : places) {
      result_.scene.contacts.push_back(Dent(place, AnyDepth(ZOf(place)), CalmSpeed(), Uniform(5.5, 14)));
      begin_s_ += Uniform(0, 0.15);
    }
  }

  // A flat plate parallel to the axis: as deep as the undeformed skin reaches beyond it.
  void Plate() {
    constexpr int kAlong = 5;
    const double length = Uniform(40, 90), turn = Uniform(-kPi, kPi);
    const double z0 = Uniform(length / 2 + 20, model_.length_mm - length / 2 - 20);
    const double depth = std::min(Uniform(4, 12), MostDepth(z0 - length / 2)), speed = CalmSpeed();
    const double radius = model_.profile.Radius(z0), pitch = length / (kAlong - 1);
    for (int i = 0; i < kAlong; ++i) {
      const double z = z0 + (i - kAlong / 2) * pitch;
      for (const double side : {-1.0, 0.0, 1.0}) {
        const double at = model_.profile.Radius(z) * std::cos(side * pitch / 2 / radius);
        const double here = depth + at - radius;
        if (here > 0.3)
          result_.scene.contacts.push_back(
              Dent({.angle_rad = turn + side * pitch / 2 / radius, .z_mm = z}, here, speed, pitch));
      }
    }
    // The whole plate moves at once.
    for (SceneContact& contact : result_.scene.contacts) {
      contact.ramp_s = std::max(2 / kRateHz, depth / speed);
      contact.end_s = contact.begin_s + 2 * contact.ramp_s + kHoldS;
    }
  }

  void Pinch() {
    const double z = Uniform(20, model_.length_mm - 20), turn = Uniform(-kPi, kPi);
    const double depth = AnyDepth(z, 0.5), speed = CalmSpeed();
    for (const double side : {0.0, kPi})
      result_.scene.contacts.push_back(Dent({.angle_rad = turn + side, .z_mm = z}, depth, speed, 12));
  }

  void Ring() {
    const double z = Uniform(25, model_.length_mm - 25), turn = Uniform(-kPi, kPi), depth = Uniform(2, 8);
    const double speed = CalmSpeed(), radius = model_.profile.Radius(z);
    for (int i = 0; i < kMaxSceneContacts; ++i) {
      const double angle = turn + 2 * kPi * i / kMaxSceneContacts;
      result_.scene.contacts.push_back(
          Dent({.angle_rad = angle, .z_mm = z}, depth, speed, 2 * kPi * radius / kMaxSceneContacts));
    }
  }

  void Slide() {
    const double way_mm = Uniform(25, 36), heading = Uniform(0, 2 * kPi), margin = 25;
    const double z = Uniform(margin, model_.length_mm - margin), turn = Uniform(-kPi, kPi);
    const double to_z = std::clamp(z + way_mm * std::cos(heading), margin, model_.length_mm - margin);
    const double around = way_mm * std::sin(heading) / model_.profile.Radius(z);
    SceneContact contact = Dent({.angle_rad = turn, .z_mm = z}, Uniform(4, 10), kFastMmPerS, 10);
    contact.move_to = SkinPlace{.angle_rad = turn + around, .z_mm = to_z};
    const double travelled = std::hypot(to_z - z, around * model_.profile.Radius(z));
    contact.end_s = contact.begin_s + std::max(travelled / kFastMmPerS, 2 * contact.ramp_s + 2 / kRateHz);
    result_.scene.contacts.push_back(contact);
  }

  void Touch() {
    switch (category_) {
      case SceneCategory::kRest:
        return;
      case SceneCategory::kInflation: {
        const double kpa = Uniform(0.5, 2.5), rise_s = 0.4 * kpa;
        result_.scene.pressure = {{kBeginS, 0},
                                  {kBeginS + rise_s, kpa},
                                  {kBeginS + rise_s + kHoldS, kpa},
                                  {kBeginS + 2 * rise_s + kHoldS, 0}};
        return;
      }
      case SceneCategory::kOneDent:
        return Dents(1);
      case SceneCategory::kTwoDents:
        return Dents(2);
      case SceneCategory::kThreeDents:
        return Dents(3);
      case SceneCategory::kPlate:
        return Plate();
      case SceneCategory::kPinch:
        return Pinch();
      case SceneCategory::kRing:
        return Ring();
      case SceneCategory::kFastPush: {
        const SkinPlace place = AnyPlace();
        result_.scene.contacts.push_back(Dent(place, AnyDepth(ZOf(place), 0.6), kFastMmPerS));
        return;
      }
      case SceneCategory::kFastSlide:
        return Slide();
      default:
        return Dents(Integer(1, 2));
    }
  }

  void Misalign(double most_mm, double most_deg) {
    for (MountError& mount : result_.scene.camera.mount) {
      for (int i = 0; i < 3; ++i) mount.shift_mm[i] = Uniform(-1, 1);
      for (int i = 0; i < 3; ++i) mount.turn_rad[i] = Uniform(-1, 1);
      mount.shift_mm *= most_mm * Uniform(0.5, 1) / mount.shift_mm.norm();
      mount.turn_rad *= RadFromDeg(most_deg) * Uniform(0.5, 1) / mount.turn_rad.norm();
    }
  }

  void Disturb() {
    CameraEffects& camera = result_.scene.camera;
    switch (category_) {
      case SceneCategory::kNoise:
        camera.sensor_noise_levels *= LogUniform(0.1, 2);
        return;
      case SceneCategory::kExposure:
        camera.exposure = LogUniform(0.25, 4);
        return;
      case SceneCategory::kFlicker:
        camera.flicker = Uniform(0.05, 0.25);
        return;
      case SceneCategory::kDefocus:
        camera.blur_px = Uniform(0.9, 1.6);
        return;
      case SceneCategory::kDirt:
        camera.dirt_specks = Integer(20, 100);
        return;
      case SceneCategory::kMisaligned:
        Misalign(2, 2);
        return;
      case SceneCategory::kMixed:
        camera.sensor_noise_levels *= LogUniform(0.5, 1.5);
        camera.exposure = LogUniform(0.5, 2);
        camera.flicker = Uniform(0, 0.08);
        camera.blur_px = Uniform(0.7, 1.1);
        camera.dirt_specks = Integer(0, 30);
        Misalign(0.7, 0.7);
        return;
      default:
        return;
    }
  }

  const LinkModel& model_;
  SceneCategory category_;
  std::mt19937_64 rng_;
  EvaluationScene result_;
  double begin_s_ = kBeginS;
};

}  // namespace

const char* Name(SceneCategory category) {
  return kNames[static_cast<size_t>(category)];
}

std::vector<EvaluationScene> GenerateScenes(const std::vector<LinkModel>& models, int count, uint64_t seed) {
  std::vector<EvaluationScene> scenes;
  for (int number = 1; static_cast<int>(scenes.size()) < count && !models.empty(); ++number) {
    for (int category = 0; category < kSceneCategoryCount; ++category) {
      for (const LinkModel& model : models) {
        if (static_cast<int>(scenes.size()) == count) return scenes;
        scenes.push_back(Generator(model, static_cast<SceneCategory>(category), number, seed).Make());
      }
    }
  }
  return scenes;
}

Result<EvaluationScene> GenerateScene(const std::vector<LinkModel>& models, const std::string& name,
                                      uint64_t seed) {
  for (int category = 0; category < kSceneCategoryCount; ++category) {
    for (const LinkModel& model : models) {
      const std::string prefix = std::string(kNames[static_cast<size_t>(category)]) + "-" + model.name + "-";
      if (name.rfind(prefix, 0) != 0) continue;
      const std::string digits = name.substr(prefix.size());
      const bool number =
          !digits.empty() && digits.size() < 7 && digits.find_first_not_of("0123456789") == std::string::npos;
      if (number && digits[0] != '0')
        return Generator(model, static_cast<SceneCategory>(category), std::stoi(digits), seed).Make();
    }
  }
  return Error{ErrorCode::kNotFound,
               "no scene '" + name + "'; names are CATEGORY-MODEL-NUMBER, such as one-dent-cylinder-3"};
}

}  // namespace taclink
