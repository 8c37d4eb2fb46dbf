#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/scene_motion.h"

namespace taclink {

/// A place on the skin: a marker's, or any.
struct SkinPlace {
  int path = 0;  ///< from 1; 0: angle_rad and z_mm say where
  int ring = 0;  ///< from 1
  double angle_rad = 0;
  double z_mm = 0;
};

/// Something that pushes along the skin's inward normal with a round patch.
struct SceneContact {
  SkinPlace at;
  std::optional<SkinPlace> move_to;  ///< slides there from begin to end at an even speed
  double patch_diameter_mm = 5.5;
  // Exactly one of the two is set.
  std::optional<double> force_n;
  /// Of the centre, along the normal from the undeformed surface. Ramps begin and end where the skin would
  /// be.
  std::optional<double> depth_mm;
  double begin_s = 0;
  double end_s = 0;
  double ramp_s = 0;  ///< smooth rise after begin and fall before end
  std::string where;  ///< "file:line", for messages
};

struct PressureKey {
  double time_s = 0;
  double kpa = 0;
};

/// How a camera is mounted off its nominal place, in the camera's own frame.
struct MountError {
  Vec3 shift_mm = Vec3::Zero();
  Vec3 turn_rad = Vec3::Zero();  ///< rotation vector

  bool any() const { return !shift_mm.isZero(0) || !turn_rad.isZero(0); }
};

/// How the cameras depart from ideal ones. Levels are of 255.
struct CameraEffects {
  double marker_jitter_px = 0;     ///< standard deviation of each drawn marker's shift, each axis
  double sensor_noise_levels = 2;  ///< standard deviation of each pixel
  double blur_px = 0.7;            ///< standard deviation of the lens' blur
  double exposure = 1;             ///< scales all brightness
  double glow = 1;                 ///< of the far LED ring; 0: none
  double vignetting = 1;           ///< darkening to the picture's edge; 0: none
  /// Standard deviation of each picture's own gain: the light flickers. Gains stay within [0.2, 3].
  double flicker = 0;
  int dirt_specks = 0;  ///< on each lens: every second one dark, the others lit
  std::array<MountError, kCameraCount> mount = {};
};

/// How a simulated skin answers.
enum class SkinKind : uint8_t {
  kLinear,     ///< small displacements, which superpose; a contact is an even load over its patch
  kNonlinear,  ///< displacements of any size, pressure that follows; a contact is a flat rigid disc
};

/// What happens to a simulated link, over time.
struct Scene {
  std::string name;
  std::string description;
  std::string model;  ///< a shipped link model's name or a file's path
  SkinKind skin = SkinKind::kNonlinear;
  int refinement = 2;  ///< of a nonlinear skin: elements per interval of the marker grid
  double frame_rate_hz = 30;
  double duration_s = 0;
  bool loop = true;
  uint64_t seed = 1;
  /// None: the skin is weightless, and nothing is known of the link's attitude.
  std::optional<SceneMotion> motion;
  std::vector<PressureKey> pressure;  ///< at least one; straight lines between them, constant outside
  std::vector<SceneContact> contacts;
  CameraEffects camera;

  /// Of a link's center, m/s^2, link frame; zero without motion: the skin is weightless. Likewise.
  Vec3 SpecificForceOf(double length_mm, double time_s) const;
  /// Within [0, duration_s], of a time since the start: a loop begins again, otherwise the end stays.
  double SceneTime(double time_s) const;
  double PressureKpa(double time_s) const;  ///< time within [0, duration_s]
};

inline constexpr int kMaxSceneContacts = 16;

/// Where a scene's cameras really are.
StereoRig MountedRig(const StereoRig& nominal, const CameraEffects& effects);

/// Loads a scene: the name of a shipped one or a path of a YAML file.
/// Errors: kNotFound (names the shipped ones), kInvalidArgument (file, line, what was expected).
Result<Scene> LoadScene(const std::string& name_or_path);

/// Parses a scene file's text; `name` stands for the file in messages.
Result<Scene> ParseScene(const std::string& name, std::string_view text);

std::vector<std::string> ShippedSceneNames();

/// A shipped scene's file, to copy and change. Empty: no such scene.
std::string_view ShippedSceneText(const std::string& name);

}  // namespace taclink
