#include "sensing/simulation/scene.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "sensing/core/embedded_file.h"
#include "sensing/core/geometry.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink {

std::span<const EmbeddedFile> EmbeddedScenes();

namespace {

constexpr int kFormatVersion = 1;

SkinPlace ReadPlace(YamlMap map) {
  SkinPlace place;
  if (map.Has("path") || map.Has("ring")) {
    place.path = map.Integer("path", {.min = 1, .max = 256});
    place.ring = map.Integer("ring", {.min = 1, .max = 256});
  } else {
    place.angle_rad = RadFromDeg(map.Number("angle_deg", {.min = -3600, .max = 3600}));
    place.z_mm = map.Number("z_mm", kNotNegative);
  }
  map.Done();
  return place;
}

SceneContact ReadContact(YamlMap& map, double duration_s) {
  SceneContact contact;
  contact.where = map.Where();
  contact.at = ReadPlace(map.Map("at"));
  if (map.Has("move_to")) contact.move_to = ReadPlace(map.Map("move_to"));
  contact.patch_diameter_mm = map.Number("patch_diameter_mm", 5.5, kPositive);
  if (map.Has("force_n")) contact.force_n = map.Number("force_n", kNotNegative);
  if (map.Has("depth_mm")) contact.depth_mm = map.Number("depth_mm", kNotNegative);
  if (contact.force_n.has_value() == contact.depth_mm.has_value())
    map.Fail("force_n", "or 'depth_mm': give exactly one of them", {"depth_mm"});
  contact.begin_s = map.Number("begin_s", {.min = 0, .max = duration_s});
  contact.end_s = map.Number("end_s", {.min = 0, .max = duration_s});
  contact.ramp_s = map.Number("ramp_s", 0.2, kNotNegative);
  if (contact.end_s <= contact.begin_s) map.Fail("end_s", "must be after begin_s", {"begin_s"});
  if (2 * contact.ramp_s > contact.end_s - contact.begin_s)
    map.Fail("ramp_s", "must fit twice between begin_s and end_s", {"begin_s", "end_s"});
  map.Done();
  return contact;
}

std::vector<PressureKey> ReadPressure(YamlMap& root) {
  if (!root.Has("pressure_keyframes"))
    return {{0, root.Number("pressure_kpa", 0.0, {.min = -10, .max = 10})}};
  if (root.Has("pressure_kpa")) root.Fail("pressure_kpa", "or 'pressure_keyframes': give only one of them");
  std::vector<PressureKey> keys;
  for (YamlMap& map : root.Maps("pressure_keyframes")) {
    const PressureKey key{map.Number("time_s", kNotNegative), map.Number("kpa", {.min = -10, .max = 10})};
    if (!keys.empty() && key.time_s <= keys.back().time_s) map.Fail("time_s", "must rise from key to key");
    map.Done();
    keys.push_back(key);
  }
  if (keys.empty()) root.Fail("pressure_keyframes", "must hold at least one {time_s, kpa}");
  return keys;
}

Vec3 ReadVector(YamlMap& map, const std::string& key, double most, const Vec3& otherwise = Vec3::Zero()) {
  if (!map.Knows(key)) return otherwise;
  const auto numbers = map.Numbers(key, 3, {.min = -most, .max = most});
  return numbers.size() == 3 ? Vec3(numbers[0], numbers[1], numbers[2]) : Vec3(Vec3::Zero());
}

MountError ReadMountError(YamlMap map) {
  MountError error;
  error.shift_mm = ReadVector(map, "shift_mm", 50);
  error.turn_rad = RadFromDeg(1) * ReadVector(map, "turn_deg", 45);
  map.Done();
  return error;
}

Swing ReadSwing(YamlMap map) {
  Swing swing;
  swing.joint = map.Text("joint", "");
  swing.axis = ReadVector(map, "axis", 1e3, swing.axis);
  if (swing.axis.norm() < 1e-9)
    map.Fail("axis", "must not be zero");
  else
    swing.axis.normalize();
  swing.pivot_mm = ReadVector(map, "pivot_mm", 1e4);
  swing.mean_rad = RadFromDeg(map.Number("mean_deg", 0.0, {.min = -360, .max = 360}));
  swing.amplitude_rad = RadFromDeg(map.Number("amplitude_deg", {.min = 0, .max = 360}));
  swing.period_s = map.Number("period_s", {.min = 0.1, .max = 1e6});
  map.Done();
  return swing;
}

std::optional<SceneMotion> ReadMotion(YamlMap& root, const Scene& scene) {
  if (!root.Has("motion")) return std::nullopt;
  if (scene.skin == SkinKind::kLinear) root.Fail("motion", "needs 'skin: nonlinear'", {"skin"});
  SceneMotion motion;
  YamlMap map = root.Map("motion");
  motion.gravity_mps2 = ReadVector(map, "gravity_mps2", 100, motion.gravity_mps2);
  if (map.Has("swing")) motion.swing = ReadSwing(map.Map("swing"));
  map.Done();
  if (motion.swing && scene.loop && !root.Failed("duration_s")) {
    const double periods = scene.duration_s / motion.swing->period_s;
    if (std::abs(periods - std::round(periods)) > 1e-6)
      root.Fail("duration_s", "must be a multiple of the swing's period_s, or 'loop: false'", {"loop"});
  }
  constexpr double kMostMps2 = 100;
  if (motion.swing && motion.MostMps2() > kMostMps2)
    root.Fail("motion",
              "accelerates by more than 100 m/s2; use a smaller amplitude, a longer period or a "
              "nearer pivot");
  // The depth of the first touch is computed for a skin at rest only.
  for (const SceneContact& contact : scene.contacts) {
    if (contact.depth_mm)
      root.Fail("contacts", "must have 'force_n' in a scene with 'motion' (" + contact.where + ")");
  }
  return motion;
}

CameraEffects ReadCameraEffects(YamlMap map) {
  CameraEffects effects;
  effects.marker_jitter_px = map.Number("marker_jitter_px", effects.marker_jitter_px, {.min = 0, .max = 20});
  effects.sensor_noise_levels =
      map.Number("sensor_noise_levels", effects.sensor_noise_levels, {.min = 0, .max = 60});
  effects.blur_px = map.Number("blur_px", effects.blur_px, {.min = 0, .max = 10});
  effects.exposure = map.Number("exposure", effects.exposure, {.min = 0, .max = 10});
  effects.glow = map.Number("glow", effects.glow, {.min = 0, .max = 5});
  effects.vignetting = map.Number("vignetting", effects.vignetting, {.min = 0, .max = 2});
  effects.flicker = map.Number("flicker", effects.flicker, {.min = 0, .max = 1});
  effects.dirt_specks = map.Integer("dirt_specks", effects.dirt_specks, {.min = 0, .max = 1000});
  if (map.Has("mount")) {
    YamlMap mount = map.Map("mount");
    for (const CameraId id : kBothCameras) {
      if (mount.Has(Name(id))) effects.mount[Index(id)] = ReadMountError(mount.Map(Name(id)));
    }
    mount.Done();
  }
  map.Done();
  return effects;
}

Result<Scene> ReadScene(YamlFile file) {
  YamlMap& root = file.root();
  Scene scene;
  root.Integer("taclink_scene", {.min = kFormatVersion, .max = kFormatVersion});
  // Another version's keys mean something else.
  if (root.Has("taclink_scene") && root.Failed("taclink_scene")) return file.Finish().error();
  scene.name = root.Text("name");
  scene.description = root.Prose("description", "");
  scene.model = root.Text("model", "cylinder");
  scene.skin =
      root.Choice("skin", {"linear", "nonlinear"}, 1) == 0 ? SkinKind::kLinear : SkinKind::kNonlinear;
  scene.refinement = root.Integer("refinement", scene.refinement, {.min = 1, .max = 4});
  scene.frame_rate_hz = root.Number("frame_rate_hz", 30.0, {.min = 0.1, .max = 1000});
  scene.duration_s = root.Number("duration_s", {.min = 0.01, .max = 1e6});
  scene.loop = root.Bool("loop", true);
  scene.seed = static_cast<uint64_t>(root.Integer("seed", 1, kNotNegative));
  scene.pressure = ReadPressure(root);
  const double last_s = root.Failed("duration_s") ? kNotNegative.max : scene.duration_s;
  for (YamlMap& map : root.Maps("contacts")) scene.contacts.push_back(ReadContact(map, last_s));
  if (scene.contacts.size() > kMaxSceneContacts)
    root.Fail("contacts", "must be at most " + std::to_string(kMaxSceneContacts));
  scene.motion = ReadMotion(root, scene);
  scene.camera = ReadCameraEffects(root.Map("camera"));
  root.Done();
  if (auto good = file.Finish(); !good) return good.error();
  return scene;
}

}  // namespace

StereoRig MountedRig(const StereoRig& nominal, const CameraEffects& effects) {
  StereoRig rig = nominal;
  for (const CameraId id : kBothCameras) {
    const MountError& error = effects.mount[Index(id)];
    if (!error.any()) continue;
    const double angle = error.turn_rad.norm();
    const Vec3 axis = angle > 0 ? Vec3(error.turn_rad / angle) : Vec3(Vec3::UnitZ());
    const Rigid3 nominal_from_real{Mat3(Eigen::AngleAxisd(angle, axis)), error.shift_mm};
    rig[id].camera_from_link = nominal_from_real.Inverse() * nominal[id].camera_from_link;
  }
  return rig;
}

Vec3 Scene::SpecificForceOf(double length_mm, double time_s) const {
  return motion ? motion->SpecificForce(time_s, Vec3(0, 0, length_mm / 2)) : Vec3(Vec3::Zero());
}

double Scene::SceneTime(double time_s) const {
  return loop ? std::fmod(time_s, duration_s) : std::min(time_s, duration_s);
}

double Scene::PressureKpa(double time_s) const {
  const auto after = std::find_if(pressure.begin(), pressure.end(),
                                  [&](const PressureKey& key) { return key.time_s > time_s; });
  if (after == pressure.begin()) return pressure.front().kpa;
  const PressureKey& left = *(after - 1);
  if (after == pressure.end()) return left.kpa;
  const double share = (time_s - left.time_s) / (after->time_s - left.time_s);
  return left.kpa + share * (after->kpa - left.kpa);
}

Result<Scene> ParseScene(const std::string& name, std::string_view text) {
  auto file = YamlFile::Parse(name, text);
  if (!file) return file.error();
  return ReadScene(std::move(*file));
}

Result<Scene> LoadScene(const std::string& name_or_path) {
  if (const auto text = ShippedSceneText(name_or_path); !text.empty()) return ParseScene(name_or_path, text);
  auto file = YamlFile::Load(name_or_path);
  if (!file && file.error().code == ErrorCode::kNotFound) {
    std::string names;
    for (const auto& name : ShippedSceneNames()) names += (names.empty() ? "" : ", ") + name;
    return Error{ErrorCode::kNotFound,
                 "scene '" + name_or_path + "' is neither a file nor a shipped scene (" + names + ")"};
  }
  if (!file) return file.error();
  return ReadScene(std::move(*file));
}

std::vector<std::string> ShippedSceneNames() {
  std::vector<std::string> names;
  for (const auto& file : EmbeddedScenes()) names.emplace_back(file.name.substr(0, file.name.rfind('.')));
  return names;
}

std::string_view ShippedSceneText(const std::string& name) {
  for (const auto& file : EmbeddedScenes()) {
    if (file.name == name + ".yaml") return file.content;
  }
  return {};
}

}  // namespace taclink
