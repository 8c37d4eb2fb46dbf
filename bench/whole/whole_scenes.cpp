#include "bench/whole/whole_scenes.h"

#include <cmath>
#include <string>
#include <utility>

#include "bench/whole/scene_maker.h"

namespace taclink {

std::vector<WholeScene> SceneMaker::Make() {
  Undisturbed();
  Pressures();
  DemoScenes();
  Swinging();
  Cameras();
  Light();
  Markers();
  Baselines();
  return std::move(scenes_);
}

WholeScene& SceneMaker::Add(const std::string& kind, double kpa) {
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

SceneContact& SceneMaker::Press(WholeScene& whole, double angle_deg, double z_mm, double diameter_mm,
                                double begin_s, double end_s) {
  SceneContact& contact = whole.scene.contacts.emplace_back();
  contact.at = {.path = 0, .ring = 0, .angle_rad = RadFromDeg(angle_deg), .z_mm = z_mm};
  contact.patch_diameter_mm = diameter_mm;
  contact.begin_s = begin_s;
  contact.end_s = end_s;
  contact.ramp_s = kRampS;
  contact.where = whole.scene.name;
  return contact;
}
WholeScene& SceneMaker::Touched(const std::string& kind, double kpa) {
  WholeScene& whole = Add(kind, kpa);
  // A slack skin gives way to little, an inflated one stands more.
  const double n = kpa == 0 ? 0.12 : kpa < 0.3 ? 0.2 : 0.45;
  Press(whole, 75, Along(0.45), 11).force_n = n;
  Press(whole, 200, Along(0.6), 11, kSecondS, kEndS + 1).force_n = 0.8 * n;
  return whole;
}

void SceneMaker::Undisturbed() {
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

void SceneMaker::Neighbors(double kpa) {
  WholeScene& whole = Add(kpa > 0 ? "neighbors, 1 kPa" : "neighbors", kpa);
  const double apart_deg = DegFromRad(40 / model_.profile.Radius(Along(0.5)));
  const double n = kpa > 0 ? 0.5 : 0.1;
  Press(whole, 0, Along(0.5), 11).force_n = n;
  Press(whole, apart_deg, Along(0.5), 11).force_n = 0.8 * n;
  Press(whole, 180, Along(0.4), 11).force_n = 0.8 * n;
  Press(whole, 180, Along(0.4) + 42, 11).force_n = n;
}
void SceneMaker::Bar() {
  WholeScene& whole = Add("bar", kUsualKpa);
  whole.is_one_body = true;
  for (int i = -2; i <= 2; ++i) Press(whole, -90, Along(0.5) + 10 * i, 9).depth_mm = 5;
}
void SceneMaker::Around(const std::string& kind, int discs, double diameter_mm, double depth_mm, double kpa) {
  WholeScene& whole = Add(kind, kpa);
  whole.is_one_body = whole.is_around = true;
  for (int i = 0; i < discs; ++i)
    Press(whole, 360.0 * i / discs, Along(0.5), diameter_mm).depth_mm = depth_mm;
}
void SceneMaker::Hand(double kpa) {
  WholeScene& whole = Add(kpa > 0 ? "hand, 1 kPa" : "hand", kpa);
  whole.is_one_body = true;
  const double depth_mm = kpa > 0 ? 4 : 5;
  for (int i = 0; i < 4; ++i) Press(whole, 30.0 * i, Along(0.4), 16).depth_mm = depth_mm;
  Press(whole, 195, Along(0.5), 40).depth_mm = depth_mm;
}
void SceneMaker::Slide(double kpa) {
  SceneContact& contact = Press(Add(kpa > 0 ? "slide, 0.8 kPa" : "slide", kpa), 90, Along(0.35), 11);
  contact.depth_mm = 5;
  contact.move_to = SkinPlace{.angle_rad = RadFromDeg(115), .z_mm = Along(0.55)};
}

// Two things touch it while it goes from upright to horizontal and back, at up to 1 rad/s.
WholeScene& SceneMaker::Swung(const std::string& kind, double kpa) {
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
WholeScene& SceneMaker::Rolled(const std::string& kind, double kpa) {
  WholeScene& whole = Touched(kind, kpa);
  whole.scene.motion = SceneMotion{
      .gravity_mps2 = {0, -kStandardGravity, 0},
      .swing =
          Swing{.axis = Vec3::UnitZ(), .mean_rad = kPi / 2, .amplitude_rad = kPi / 2, .period_s = 2 * kEndS}};
  return whole;
}

// What deploy/demo shows.
void SceneMaker::DemoScenes() {
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

void SceneMaker::Swinging() {
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

void SceneMaker::MountedOff(double kpa) {
  for (const int axis : {0, 1, 2}) {
    const std::string about = std::string(" about ") + "xyz"[axis];
    WholeScene& off = Swung("swinging, mounted 20 deg off" + about + (kpa > 0 ? ", 0.5 kPa" : ""), kpa);
    off.fault.mount_off_rad = RadFromDeg(20) * Vec3::Unit(axis);
    off.named_by = {ReasonId::kAttitudeMismatch};
  }
}

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
  return fault.pictures != PictureFault::kNone || fault.pressure_error_mpa != 0 ||
         !fault.is_pressure_reported || !fault.is_attitude_known || !fault.mount_off_rad.isZero(0) ||
         fault.modulus_factor != 1 || !fault.configured_model.empty() || fault.calibration_off.any() ||
         fault.tare_s >= 0 || fault.follows_drift || fault.aging.any() || !fault.lost_markers.empty() ||
         scene.kind.starts_with("started while touched");
}

std::vector<WholeScene> WholeScenes(const LinkModel& model) {
  return SceneMaker(model).Make();
}

}  // namespace taclink
