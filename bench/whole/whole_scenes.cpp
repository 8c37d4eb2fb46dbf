#include "bench/whole/whole_scenes.h"

#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink {
namespace {

constexpr double kRateHz = 30;
constexpr double kInflateS = 0.5, kInflatedS = 1.2, kTouchS = 1.4, kSecondS = 3, kFaultS = 2.4, kLetGoS = 4.2,
                 kEndS = 5;
constexpr double kRampS = 0.5;
constexpr double kUsualKpa = 0.5;         // a link's faults do not wait for a slack skin
constexpr int kWholeTruthRefinement = 3;  // finer than any link's mesh

class SceneMaker {
 public:
  explicit SceneMaker(const LinkModel& model) : model_(model) {}

  std::vector<WholeScene> Make() {
    Undisturbed();
    Pressures();
    DemoScenes();
    Swinging();
    Cameras();
    Light();
    Baselines();
    return std::move(scenes_);
  }

 private:
  WholeScene& Add(const std::string& kind, double kpa = 0) {
    WholeScene& whole = scenes_.emplace_back();
    whole.kind = kind;
    whole.model = model_.name;
    Scene& scene = whole.scene;
    scene.contacts.reserve(kMaxSceneContacts);
    scene.name = kind + ", " + model_.name;
    scene.model = model_.name;
    scene.refinement = kWholeTruthRefinement;
    scene.frame_rate_hz = kRateHz;
    scene.loop = false;
    scene.duration_s = kEndS;
    scene.seed = scenes_.size();
    // No link is built as its model says.
    scene.camera.mount = {MountError{.shift_mm = {0.4, -0.3, 0.3}, .turn_rad = {0.006, 0.004, -0.01}},
                          MountError{.shift_mm = {-0.3, 0.4, -0.2}, .turn_rad = {-0.004, 0.006, 0.008}}};
    scene.pressure = {{kInflateS, 0}, {kInflatedS, kpa}};
    if (kpa == 0) scene.pressure = {{0, 0}};
    whole.frames = static_cast<int>(kEndS * kRateHz);
    return whole;
  }

  // A disc; `angle_deg` and share of the length say where.
  static SceneContact& Press(WholeScene& whole, double angle_deg, double z_mm, double diameter_mm,
                             double begin_s = kTouchS, double end_s = kLetGoS) {
    SceneContact& contact = whole.scene.contacts.emplace_back();
    contact.at = {.path = 0, .ring = 0, .angle_rad = RadFromDeg(angle_deg), .z_mm = z_mm};
    contact.patch_diameter_mm = diameter_mm;
    contact.begin_s = begin_s;
    contact.end_s = end_s;
    contact.ramp_s = kRampS;
    contact.where = whole.scene.name;
    return contact;
  }
  double Along(double share) const { return share * model_.length_mm; }
  double Ring(int ring) const {
    return model_.markers.rings_z_mm[static_cast<size_t>(ring < 0 ? model_.markers.rings() + ring : ring)];
  }

  // One disc that stays, and another that comes later: what is wrong with pictures shows when the skin moves.
  WholeScene& Touched(const std::string& kind, double kpa = 0) {
    WholeScene& whole = Add(kind, kpa);
    // A slack skin gives way to little, an inflated one stands more.
    const double n = kpa == 0 ? 0.12 : kpa < 0.3 ? 0.2 : 0.45;
    Press(whole, 75, Along(0.45), 11).force_n = n;
    Press(whole, 200, Along(0.6), 11, kSecondS, kEndS + 1).force_n = 0.8 * n;
    return whole;
  }

  void Undisturbed() {
    Add("rest");
    Add("inflated", 1);
    Touched("touched");
    Touched("touched, 0.1 kPa", 0.1);
    Touched("touched, 0.5 kPa", kUsualKpa);
    Touched("touched, 1 kPa", 1);
    Touched("touched, 1.5 kPa", 1.5);
    Press(Add("pin"), 20, Along(0.35), 5.5).force_n = 0.2;
    Press(Add("deep"), 130, Along(0.5), 11).depth_mm = 11;
    Press(Add("first ring"), -40, Ring(0) + 6, 11).force_n = 0.25;
    Press(Add("last ring, 1 kPa", 1), 160, Ring(-1) - 6, 11).force_n = 0.4;
    Neighbors(0);
    Neighbors(1);
    Press(Add("plate"), 10, Along(0.5), 40).force_n = 0.1;
    Press(Add("plate, 1 kPa", 1), 10, Along(0.5), 40).force_n = 1.2;
    Bar();
    Around("squeeze", 6, 25, 6, 0);
    Around("squeeze, 1 kPa", 6, 25, 4, 1);
    Around("hug", 14, 12, 3, 0);
    Hand(0);
    Hand(1);
    Slide(0);
    Slide(0.8);
    WholeScene& ramp = Touched("pressure ramp while touched");
    ramp.scene.pressure = {{1.8, 0}, {2.8, 1}, {3.2, 1}, {4.2, 0.2}};
  }

  void Neighbors(double kpa) {
    WholeScene& whole = Add(kpa > 0 ? "neighbors, 1 kPa" : "neighbors", kpa);
    const double apart_deg = DegFromRad(40 / model_.profile.Radius(Along(0.5)));
    const double n = kpa > 0 ? 0.5 : 0.1;
    Press(whole, 0, Along(0.5), 11).force_n = n;
    Press(whole, apart_deg, Along(0.5), 11).force_n = 0.8 * n;
    Press(whole, 180, Along(0.4), 11).force_n = 0.8 * n;
    Press(whole, 180, Along(0.4) + 42, 11).force_n = n;
  }
  void Bar() {
    WholeScene& whole = Add("bar", kUsualKpa);
    whole.is_one_body = true;
    for (int i = -2; i <= 2; ++i) Press(whole, -90, Along(0.5) + 10 * i, 9).depth_mm = 5;
  }
  void Around(const std::string& kind, int discs, double diameter_mm, double depth_mm, double kpa) {
    WholeScene& whole = Add(kind, kpa);
    whole.is_one_body = whole.is_around = true;
    for (int i = 0; i < discs; ++i)
      Press(whole, 360.0 * i / discs, Along(0.5), diameter_mm).depth_mm = depth_mm;
  }
  void Hand(double kpa) {
    WholeScene& whole = Add(kpa > 0 ? "hand, 1 kPa" : "hand", kpa);
    whole.is_one_body = true;
    const double depth_mm = kpa > 0 ? 4 : 5;
    for (int i = 0; i < 4; ++i) Press(whole, 30.0 * i, Along(0.4), 16).depth_mm = depth_mm;
    Press(whole, 195, Along(0.5), 40).depth_mm = depth_mm;
  }
  void Slide(double kpa) {
    SceneContact& contact = Press(Add(kpa > 0 ? "slide, 0.8 kPa" : "slide", kpa), 90, Along(0.35), 11);
    contact.depth_mm = 5;
    contact.move_to = SkinPlace{.angle_rad = RadFromDeg(115), .z_mm = Along(0.55)};
  }

  void Pressures() {
    using enum ReasonId;
    for (const double off_pa : {-100.0, 100.0}) {
      WholeScene& whole =
          Touched(off_pa < 0 ? "pressure told 100 Pa too low" : "pressure told 100 Pa too high", 1);
      whole.fault.pressure_off_mpa = 1e-6 * off_pa;
    }
    WholeScene& wrong = Touched("pressure told 400 Pa too high", 1);
    wrong.fault.pressure_off_mpa = 4e-4;
    wrong.named_by = {kPressureMismatch};
    for (const double kpa : {0.1, 0.5, 1.0}) {
      char kind[40];
      std::snprintf(kind, sizeof kind, "no pressure source, %.1f kPa", kpa);
      WholeScene& whole = Touched(kind, kpa);
      whole.fault.is_pressure_told = false;
      whole.named_by = {kPressureUnknown};
    }
    for (const double kpa : {0.1, 0.5, 1.0}) {
      char kind[60];
      std::snprintf(kind, sizeof kind, "no pressure source, inflated to %.1f kPa before", kpa);
      WholeScene& whole = Touched(kind, kpa);
      whole.scene.pressure = {{0, kpa}};
      whole.fault.is_pressure_told = false;
      whole.named_by = {kPressureUnknown};
    }
    Touched("E told 10 % too high, 0.5 kPa", kUsualKpa).fault.modulus_factor = 1.1;
    Touched("E told 10 % too low, 1 kPa", 1).fault.modulus_factor = 0.9;
  }

  // Two things touch it while it goes from upright to horizontal and back, at up to 1 rad/s.
  WholeScene& Swung(const std::string& kind, double kpa = 0) {
    WholeScene& whole = Touched(kind, kpa);
    constexpr double kReachMm = 150;
    whole.scene.motion = SceneMotion{.swing = Swing{.axis = Vec3::UnitX(),
                                                    .pivot_mm = {0, 0, -kReachMm},
                                                    .mean_rad = kPi / 4,
                                                    .amplitude_rad = kPi / 4,
                                                    .period_s = kEndS}};
    return whole;
  }
  // Horizontal, it rolls by half a turn.
  WholeScene& Rolled(const std::string& kind, double kpa = 0) {
    WholeScene& whole = Touched(kind, kpa);
    whole.scene.motion = SceneMotion{
        .gravity_mps2 = {0, -kStandardGravity, 0},
        .swing = Swing{
            .axis = Vec3::UnitZ(), .mean_rad = kPi / 2, .amplitude_rad = kPi / 2, .period_s = 2 * kEndS}};
    return whole;
  }

  // What deploy/demo shows.
  void DemoScenes() {
    for (const char* name : {"swing_lower", "swing_upper", "swing_tip"}) {
      const Scene scene = LoadScene(name).value();
      if (scene.model != model_.name) continue;
      WholeScene& whole = Add(std::string("demo, ") + name);
      whole.scene.duration_s = scene.duration_s;
      whole.scene.pressure = scene.pressure;
      whole.scene.contacts = scene.contacts;
      whole.scene.motion = scene.motion;
      whole.frames = static_cast<int>(scene.duration_s * kRateHz);
    }
  }

  void Swinging() {
    Swung("swinging, 0.5 kPa", kUsualKpa);
    Swung("swinging, 1 kPa", 1);
    Rolled("rolling, 0.5 kPa", kUsualKpa);
    // A slack barrel that lies has no equilibrium under these discs.
    if (model_.name == "cylinder") {
      Swung("swinging");
      Rolled("rolling");
      Swung("swinging, attitude unknown").fault.is_attitude_known = false;
      MountedOff(0);
    }
    MountedOff(kUsualKpa);
  }

  void MountedOff(double kpa) {
    for (const int axis : {0, 1, 2}) {
      const std::string about = std::string(" about ") + "xyz"[axis];
      WholeScene& off = Swung("swinging, mounted 20 deg off" + about + (kpa > 0 ? ", 0.5 kPa" : ""), kpa);
      off.fault.mount_off_rad = RadFromDeg(20) * Vec3::Unit(axis);
      off.named_by = {ReasonId::kAttitudeMismatch};
    }
  }

  // From the beginning, which calibration may take up, and within the run.
  void Trouble(const std::string& kind, PictureFault fault, double amount,
               std::array<bool, kCameraCount> cameras, std::vector<ReasonId> named_by,
               bool from_start = true) {
    WholeScene& onset = Touched(kind, kUsualKpa);
    onset.fault.pictures = fault;
    onset.fault.amount = amount;
    onset.fault.cameras = cameras;
    onset.named_by = named_by;
    onset.fault.begin_s = kFaultS;
    if (!from_start) return;
    WholeScene always = onset;
    always.kind += ", always";
    always.scene.name += ", always";
    always.fault.begin_s = -1;
    // What there was when the cameras were calibrated may have been taken up; but swapped ones without a
    // calibration are a link that is mounted the other way round, for all that pictures can tell.
    always.named_by.clear();
    always.fault.is_calibrated = fault == PictureFault::kSwapped;
    scenes_.push_back(std::move(always));
  }

  void Cameras() {
    using enum ReasonId;
    constexpr std::array<bool, kCameraCount> kTop = {true, false}, kBottom = {false, true},
                                             kBoth = {true, true};
    const std::vector<ReasonId> moved = {kCamerasMoved, kCamerasDisagree, kLabels, kResidual};
    Trouble("top frozen", PictureFault::kFrozen, 0, kTop, {ReasonId::kFrozen}, false);
    Trouble("bottom frozen", PictureFault::kFrozen, 0, kBottom, {ReasonId::kFrozen}, false);
    Trouble("both frozen", PictureFault::kFrozen, 0, kBoth, {ReasonId::kFrozen}, false);
    Trouble("top 0.2 s late", PictureFault::kLate, 0.2, kTop, {kLate, kCamerasDisagree, kResidual, kLabels});
    Trouble("bottom 0.1 s late", PictureFault::kLate, 0.1, kBottom,
            {kLate, kCamerasDisagree, kResidual, kLabels});
    Trouble("top 0.5 s late", PictureFault::kLate, 0.5, kTop, {kLate, kCamerasDisagree, kResidual, kLabels});
    LateSlowly();
    Trouble("crossed", PictureFault::kCrossed, 0, kTop, {kCamerasDisagree, kResidual, kLabels});
    Trouble("swapped", PictureFault::kSwapped, 0, kBoth, {kCamerasDisagree, kResidual, kLabels});
    Trouble("top rolled by 5 deg", PictureFault::kRolled, 5, kTop, moved);
    Trouble("top rolled by 90 deg", PictureFault::kRolled, 90, kTop, moved);
    Trouble("top rolled by 180 deg", PictureFault::kRolled, 180, kTop, moved);
    // What is taken up.
    Trouble("top shifted by 0.35 px", PictureFault::kShifted, 0.35, kTop, {}, false);
    Trouble("bottom moved by 0.2 mm", PictureFault::kMoved, 0.2, kBottom, {}, false);
    Trouble("bottom turned by 0.08 deg", PictureFault::kTurned, 0.08, kBottom, {}, false);
    // And what is more than that.
    Trouble("top shifted by 1 px", PictureFault::kShifted, 1, kTop, moved);
    Trouble("top shifted by 3 px", PictureFault::kShifted, 3, kTop, moved);
    Trouble("bottom moved by 0.3 mm", PictureFault::kMoved, 0.3, kBottom, moved);
    Trouble("bottom turned by 0.3 deg", PictureFault::kTurned, 0.3, kBottom, moved);
    Trouble("both moved by 1 mm", PictureFault::kMoved, 1, kBoth, moved);
    Trouble("top scaled by 2 %", PictureFault::kScaled, 1.02, kTop, moved);
    Trouble("top scaled by 10 %", PictureFault::kScaled, 1.1, kTop, moved);
    WholeScene& other = Touched("another link's calibration", kUsualKpa);
    other.fault.is_calibrated = true;
    other.fault.calibration_off = {.shift_mm = {0.7, -0.5, 0.6}, .turn_rad = {0.01, -0.008, 0.02}};
    other.named_by = moved;
    WholeScene& wrong = Touched("wrong model", kUsualKpa);
    wrong.fault.told_model = model_.name == "cylinder" ? "barrel" : "cylinder";
    wrong.named_by = {kResidual};
  }

  // Where the two pictures differ little from frame to frame, or one of them shows little.
  void LateSlowly() {
    using enum ReasonId;
    for (const bool is_slow : {true, false}) {
      WholeScene& whole =
          Add(is_slow ? "slow press, top 0.5 s late" : "press near the end, top 0.2 s late", kUsualKpa);
      SceneContact& contact = Press(whole, 90, Along(is_slow ? 0.5 : 0.2), 11);
      contact.force_n = 0.45;
      if (is_slow) contact.ramp_s = (kLetGoS - kTouchS) / 2;
      whole.fault.pictures = PictureFault::kLate;
      whole.fault.amount = is_slow ? 0.5 : 0.2;
      whole.fault.cameras = {true, false};
      whole.named_by = {kLate, kCamerasDisagree, kResidual, kLabels};
    }
  }

  void Light() {
    using enum ReasonId;
    constexpr std::array<bool, kCameraCount> kTop = {true, false}, kBoth = {true, true};
    const std::vector<ReasonId> dim = {kFewMarkers, kSparseMarkers, kCamera, kLabels};
    Trouble("top hazed", PictureFault::kHazed, 0.6, kTop, {});
    Trouble("top blurred by 3 px", PictureFault::kBlurred, 3, kTop, {});
    Trouble("top half covered", PictureFault::kCovered, 0.5, kTop, {});
    Trouble("both half covered", PictureFault::kCovered, 0.5, kBoth, dim);
    Trouble("top lamp out", PictureFault::kDark, 0.03, kTop, {});
    Trouble("both lamps out", PictureFault::kDark, 0.03, kBoth, dim);
    Trouble("noise of 5 levels", PictureFault::kNoisy, 4.6, kBoth, {});
    Trouble("blur of 1.5 px", PictureFault::kBlurred, 1.33, kBoth, {});
    Trouble("one dark side", PictureFault::kDarkSide, 0.25, kBoth, {});
    Trouble("light falls off tenfold", PictureFault::kFalloff, 0.1, kBoth, {});
    Trouble("glow in the middle", PictureFault::kGlow, 40, kBoth, {});
    Trouble("rim reflections", PictureFault::kRim, 0.3, kBoth, {});
    Trouble("JPEG at quality 70", PictureFault::kJpeg, 70, kBoth, {});
  }

  void Baselines() {
    for (const bool calibrated : {false, true}) {
      for (const double kpa : {0.0, 1.0}) {
        WholeScene& whole = Add(std::string("started while touched") + (kpa > 0 ? ", 1 kPa" : "") +
                                (calibrated ? ", calibrated" : ""));
        whole.scene.pressure = {{0, kpa}};
        Press(whole, 75, Along(0.45), 11, -1, 2.5).force_n = kpa > 0 ? 0.3 : 0.1;
        Press(whole, 200, Along(0.6), 11, kSecondS, kEndS + 1).force_n = kpa > 0 ? 0.3 : 0.1;
        whole.fault.is_calibrated = calibrated;
      }
    }
    for (const double kpa : {0.5, 1.0, 1.5}) {
      char kind[40];
      std::snprintf(kind, sizeof kind, "baseline under %.1f kPa", kpa);
      WholeScene& whole = Touched(kind);
      whole.scene.pressure = {{2, kpa}, {3.5, kpa - 0.15}};
      whole.fault.is_calibrated = true;
    }
    WholeScene& tared = Touched("tared while touched", kUsualKpa);
    tared.fault.tare_s = 2.2;
    Hour("a thing rests on it for an hour", {});
    Aging();
  }

  // It lets go before the end, and what the skin keeps of it is no force.
  void Hour(const std::string& kind, const SkinAging& aging) {
    WholeScene& resting = Add(kind);
    constexpr double kHourS = 3600, kSlowHz = 0.2;
    resting.fault.aging = aging;
    resting.scene.frame_rate_hz = kSlowHz;
    resting.scene.duration_s = kHourS;
    resting.frames = static_cast<int>(kHourS * kSlowHz);
    SceneContact& thing = Press(resting, 90, Along(0.5), 20, 300, 3000);
    thing.force_n = 0.06;
    thing.ramp_s = 60;
    resting.fault.follows_drift = true;
  }

  void Aging() {
    constexpr SkinAging kSets = {.set_share = 0.05}, kWarmer = {.warmer_k = 10};
    Touched("dents leave 5 %").fault.aging = kSets;
    Touched("dents leave 5 %, 0.5 kPa", kUsualKpa).fault.aging = kSets;
    Hour("a thing rests on it for an hour and leaves 5 %", kSets);
    Touched("10 K warmer").fault.aging = kWarmer;
    Touched("10 K warmer, 0.5 kPa", kUsualKpa).fault.aging = kWarmer;
    WholeScene& unknown = Touched("10 K warmer, no pressure source");
    unknown.fault.aging = kWarmer;
    unknown.fault.is_pressure_told = false;
    unknown.named_by = {ReasonId::kPressureUnknown};
  }

  const LinkModel& model_;
  std::vector<WholeScene> scenes_;
};

}  // namespace

std::string SkinKey(const WholeScene& whole) {
  const Scene& scene = whole.scene;
  std::string key = whole.model + " " + std::to_string(scene.duration_s);
  const auto add = [&](double number) { key += " " + std::to_string(number); };
  for (const PressureKey& pressure : scene.pressure) add(pressure.time_s), add(pressure.kpa);
  for (const SceneContact& contact : scene.contacts) {
    key += ";";
    add(contact.at.angle_rad), add(contact.at.z_mm), add(contact.patch_diameter_mm);
    add(contact.force_n.value_or(-1)), add(contact.depth_mm.value_or(-1));
    add(contact.begin_s), add(contact.end_s), add(contact.ramp_s);
    if (contact.move_to) add(contact.move_to->angle_rad), add(contact.move_to->z_mm);
  }
  if (scene.motion) {
    const Vec3& gravity = scene.motion->gravity_mps2;
    key += ";";
    add(gravity.x()), add(gravity.y()), add(gravity.z());
  }
  if (scene.motion && scene.motion->swing) {
    const Swing& swing = *scene.motion->swing;
    for (int i = 0; i < 3; ++i) add(swing.axis[i]), add(swing.pivot_mm[i]);
    add(swing.mean_rad), add(swing.amplitude_rad), add(swing.period_s);
  }
  return key;
}

bool IsFault(const WholeScene& scene) {
  const LinkFault& fault = scene.fault;
  return fault.pictures != PictureFault::kNone || fault.pressure_off_mpa != 0 || !fault.is_pressure_told ||
         !fault.is_attitude_known || !fault.mount_off_rad.isZero(0) || fault.modulus_factor != 1 ||
         !fault.told_model.empty() || fault.calibration_off.any() || fault.tare_s >= 0 ||
         fault.follows_drift || fault.aging.any() || scene.kind.starts_with("started while touched");
}

std::vector<WholeScene> WholeScenes(const LinkModel& model) {
  return SceneMaker(model).Make();
}

}  // namespace taclink
