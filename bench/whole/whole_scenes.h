#pragma once

#include <array>
#include <string>
#include <vector>

#include "bench/vision/skin_aging.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/simulation/scene.h"

namespace taclink {

/// What the world does to a link's pictures.
enum class PictureFault : int {
  kNone,
  kFrozen,     ///< the same picture again and again
  kLate,       ///< of `amount` seconds ago
  kCrossed,    ///< of another link's camera
  kSwapped,    ///< of this link's other camera
  kRolled,     ///< turned by `amount` degrees about its middle
  kShifted,    ///< by `amount` px
  kMoved,      ///< the camera itself, by `amount` mm across its axis
  kTurned,     ///< the camera itself, by `amount` degrees about an axis in the picture
  kScaled,     ///< about its middle, by a factor of `amount`
  kHazed,      ///< `amount` of the light is spread evenly over the picture
  kBlurred,    ///< by `amount` px more
  kCovered,    ///< `amount` of its width is dark
  kDark,       ///< `amount` of the light is left
  kNoisy,      ///< `amount` gray levels more, each pixel
  kDarkSide,   ///< one side has `amount` of the light
  kFalloff,    ///< light falls to `amount` toward the far end, which is the picture's middle
  kGlow,       ///< a bright disc of `amount` px in the middle
  kRim,        ///< a bright reflection along `amount` of the rim
  kJpeg,       ///< compressed with quality `amount`
  kReencoded,  ///< the same image again and again, compressed anew each time
  kHalfRate,   ///< every second image is the one before
  kTorn,       ///< the lower half is of `amount` seconds ago
  kMirrored,   ///< left and right exchanged
  kTwice,      ///< both images are of the top camera
  kBlended,    ///< `amount` of it is the image before, which is blended likewise
  kHair,       ///< a dark hair of `amount` px in width lies across the lens
  kDrop,       ///< a drop of `amount` px in radius on the lens magnifies what is behind it
  kVibrating,  ///< shifted from image to image by up to `amount` px along each axis, both cameras alike
};

/// One trouble, and since when.
struct LinkFault {
  PictureFault pictures = PictureFault::kNone;
  std::array<bool, kCameraCount> cameras = {true, true};
  double amount = 0;
  double begin_s = -1;            ///< before 0: always; of `pictures` alone
  double grows_s = 0;             ///< from nothing to `amount` within that time; of light and lens alone
  std::vector<int> lost_markers;  ///< break off at `lost_s`, one after the other within `grows_s`
  double lost_s = -1;             ///< before 0: they were never there
  double pressure_error_mpa = 0;  ///< reported less true
  bool is_pressure_reported = true;
  bool is_attitude_known = true;      ///< of a scene with motion
  Vec3 mount_off_rad = Vec3::Zero();  ///< rotation vector by which the measured attitude is wrong, link frame
  double modulus_factor = 1;          ///< configured, by the true one
  std::string configured_model;       ///< another than the skin's; empty: the skin's
  bool is_calibrated = false;         ///< the cameras are known beforehand
  MountError calibration_off;         ///< and where they are not, the top one
  double tare_s = -1;                 ///< a tare is asked for then; before 0: none
  bool follows_drift = false;
  SkinAging aging;
};

/// A scene of the whole way, from pictures to forces.
struct WholeScene {
  std::string kind, model;
  Scene scene;
  int frames = 0;
  bool is_one_body = false;  ///< all contacts are of one body, whose sum is judged
  bool is_around = false;    ///< which presses alike all around at one place along the link
  LinkFault fault;
  /// Any of these names the fault. Empty: nothing is wrong, or what is has to be taken up.
  std::vector<ReasonId> named_by;
};

/// Scenes that have the same move the same skin alike.
std::string SkinKey(const WholeScene& scene);

/// A fault of the link that must be reported by its reason, or compensated.
bool IsFault(const WholeScene& scene);

/// Undisturbed and disturbed scenes of a skin; `model` is the shipped cylinder, or one of about its size.
std::vector<WholeScene> WholeScenes(const LinkModel& model);

}  // namespace taclink
