#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"
#include "sensing/core/simulation_report.h"

namespace taclink {

enum class PixelFormat { kGray8, kYuyv, kMjpeg };

/// A picture as the camera sent it. The buffer is reused from frame to frame.
struct RawImage {
  PixelFormat format = PixelFormat::kGray8;
  int width_px = 0;
  int height_px = 0;
  std::vector<uint8_t> bytes;
  bool valid = false;            ///< false: this camera gave no picture for this frame
  std::string why_missing = {};  ///< for people, when not valid; may be empty
};

/// The pictures of one moment, top and bottom.
using RawPictures = std::array<RawImage, kCameraCount>;

/// When things happened to a frame. Nanoseconds; 0: has not happened. Monotonic times are CLOCK_MONOTONIC's.
struct FrameTimes {
  int64_t exposure_monotonic_ns = 0;  ///< start of exposure of the earlier picture, from the driver
  int64_t exposure_utc_ns = 0;        ///< the same, since 1970-01-01 UTC
  int64_t received_ns = 0;            ///< both pictures are in memory
  int64_t tracked_ns = 0;             ///< markers labelled
  int64_t solved_ns = 0;              ///< forces and contacts known
  int64_t published_ns = 0;           ///< handed to the hub
};

/// Who says what the pressure inside a skin is.
enum class PressureOrigin : uint8_t {
  kNone,       ///< nobody: 0 for the baseline; what came since, the skin's shape tells
  kConstant,   ///< the configuration
  kSimulated,  ///< the simulation that makes the pictures
  kFile,       ///< a sensor, through a file or pipe
  kSerial,     ///< a sensor on a serial line
  kClient,     ///< a client of the server
  kRegulator,  ///< the sensor of the regulator that inflates the skin
};

/// How the pressure of a frame is known.
struct PressureReport {
  PressureOrigin origin = PressureOrigin::kNone;
  bool stale = false;        ///< the sensor's newest reading is too old, or there is none: it is not used
  double mpa = 0;            ///< the newest reading, or what is assumed
  int64_t age_ns = -1;       ///< from the reading to the exposure; -1: there is no reading
  std::string trouble = {};  ///< what is wrong with the sensor and what to do; empty: nothing

  /// Configured, not measured.
  bool assumed() const { return origin == PressureOrigin::kNone || origin == PressureOrigin::kConstant; }
};

/// `mpa` rounded to 2^-40 MPa (a millionth of a pascal): such a pressure is the same number again after a
/// way through Pa (times 10^6 = 2^6 5^6, which needs 14 bits more), so that a log can be solved again bit for
/// bit.
inline double ExactInPascals(double mpa) {
  return std::ldexp(std::round(std::ldexp(mpa, 40)), -40);
}

/// The source of the specific force in a link's frame.
enum class AttitudeOrigin : uint8_t {
  kNone,         ///< nobody: it is estimated from the shape of the skin
  kConstant,     ///< the configuration, or a command's options
  kSimulated,    ///< the simulation that makes the pictures
  kJointStates,  ///< the arm's URDF and joint states
  kClient,       ///< a client of the server
};

/// Gravity less the link's acceleration, link frame, as it is known at a moment.
struct SpecificForceReading {
  Vec3 mps2 = Vec3::Zero();
  Mat3 covariance = Mat3::Zero();  ///< (m/s^2)^2; zero: it counts as exact
  AttitudeOrigin origin = AttitudeOrigin::kConstant;
  std::string trouble = {};  ///< what is wrong with its source and what to do; empty: nothing
};

/// State of the arm's joint that moves a simulated link, at the exposure.
struct SimulatedJoint {
  std::string name;
  double position_rad = 0, velocity_radps = 0;  ///< rad, rad/s
};

struct LinkState;

/// What a link's cameras saw at one moment.
struct StereoFrame {
  uint64_t sequence = 0;  ///< counts exposures of this source; a gap is a frame that was not seen
  int64_t period_ns = 0;  ///< of its source's frame rate; 0: not known
  FrameTimes times;
  RawPictures images;
  std::optional<double> pressure_mpa;  ///< gauge pressure inside the skin at that time; none: not measured
  PressureReport pressure;
  /// None: the link never moves, so that its weight is the same in all frames.
  std::optional<SpecificForceReading> specific_force;
  std::optional<SimulationReport> simulation = {};  ///< none: it is not simulated
  std::optional<SimulatedJoint> joint = {};         ///< none: it is not simulated, or rests
  /// From a log: what was found then, in place of pictures; null: from cameras.
  std::shared_ptr<const LinkState> recorded = nullptr;
};

}  // namespace taclink
