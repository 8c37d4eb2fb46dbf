#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/result.h"

/// Client of a TacLINK server. Everything is in SI units (m, N, Pa, s, rad); vectors of a link are in its
/// frame: origin in the centre of the clamped end at the top camera's side, +z along the axis.
namespace taclink::client {

using Vector3 = std::array<double, 3>;
/// Symmetric: xx, xy, xz, yy, yz, zz.
using Covariance3 = std::array<double, 6>;
/// Standard deviations of the three components.
Vector3 Sigmas(const Covariance3& covariance);

enum class Detail {
  kContacts,  ///< status, times, contacts, total force
  kGeometry,  ///< and marker positions
  kFull,      ///< and displacements, covariances, nodal forces, sources
};

enum class Delivery {
  kLatest,  ///< only the newest frame of each link waits
  kEvery,   ///< all wait in order in a bounded queue; the oldest fall out
};

enum class LinkStatus { kUnknown, kStarting, kCalibrating, kOk, kDegraded, kLost };
const char* Name(LinkStatus status);  ///< "ok", "lost", ...

enum class ForceModel { kUnknown, kLiteral, kLinear, kPressurised, kNonlinear };
const char* Name(ForceModel model);

enum class MarkerSource : uint8_t { kUnknown, kBoth, kTop, kBottom, kInferred };

enum class SourceKind { kUnknown, kV4l2, kFiles, kSimulated };
const char* Name(SourceKind kind);

/// A type of link. Per-marker data, here and in Frame, is ring by ring: index = ring * paths + path, from 0.
struct LinkModel {
  std::string name;
  std::string description;
  double length_m = 0;
  double thickness_m = 0;
  double tube_radius_m = 0;  ///< 0: no tube
  double youngs_modulus_pa = 0;
  double poisson_ratio = 0;
  int paths = 0;
  int rings = 0;
  double first_path_angle_rad = 0;  ///< path i lies at this + i 2 pi / paths, from +x towards +y
  std::vector<double> ring_z_m;
  double marker_diameter_m = 0;
  std::vector<Vector3> rest_positions_m;  ///< by marker
  std::vector<double> profile_z_m;        ///< outer surface at rest: radius over z
  std::vector<double> profile_radius_m;
};

/// p_in_base = rotation * p_in_link + translation.
struct Pose {
  Vector3 translation_m{};
  std::array<double, 4> rotation_xyzw{0, 0, 0, 1};  ///< unit quaternion
};

struct Link {
  std::string name;
  int index = 0;
  LinkModel model;
  Pose base_from_link;
  SourceKind source = SourceKind::kUnknown;
  std::string source_description;
  LinkStatus status = LinkStatus::kUnknown;
  std::string status_reason;  ///< empty when the status is kOk
  double rate_hz = 0;         ///< frames solved, over the last 2 s
  double latency_p50_s = 0;   ///< exposure to hand-over, last 300 frames; 0: none yet
  double latency_p99_s = 0;
  uint64_t frames = 0;  ///< since the server started
  uint64_t frames_skipped = 0;
  uint64_t source_restarts = 0;
  int contacts = 0;
};

struct Arm {
  std::string name;
  std::string server_version;
  std::vector<Link> links;
};

struct Contact {
  uint64_t id = 0;                                  ///< lasts while the contact does
  Vector3 center_m{};                               ///< on the deformed outer surface
  Vector3 normal{};                                 ///< unit, away from the axis
  Vector3 force_n{};                                ///< what the world exerts on the skin
  std::optional<Covariance3> force_covariance_n2;   ///< none: not known
  std::optional<Covariance3> center_covariance_m2;  ///< likewise
  double normal_force_n = 0;                        ///< pressing in is positive
  double area_m2 = 0;
  std::vector<int> markers;
};

/// Nanoseconds; 0: has not happened. Monotonic times are the server's.
struct FrameTimes {
  int64_t exposure_utc_ns = 0;  ///< since 1970-01-01
  int64_t exposure_ns = 0;
  int64_t received_ns = 0;
  int64_t tracked_ns = 0;
  int64_t solved_ns = 0;
  int64_t published_ns = 0;
  int64_t client_utc_ns = 0;  ///< this client had it
};

struct StageTimes {
  double decode_s = 0, detect_s = 0, register_s = 0, reconstruct_s = 0, force_s = 0;
};

struct Frame {
  std::string link;
  int link_index = 0;
  uint64_t sequence = 0;
  FrameTimes times;
  LinkStatus status = LinkStatus::kUnknown;
  std::string status_reason;
  std::optional<double> pressure_pa;
  int markers_seen = 0;
  int markers_inferred = 0;
  std::vector<Contact> contacts;
  Vector3 total_force_n{};
  ForceModel force_model = ForceModel::kUnknown;
  double baseline_age_s = 0;
  StageTimes stage_times;
  bool tracked = false;      ///< markers were followed; else the full pictures were searched
  double picture_share = 0;  ///< part of both pictures' pixels that were read

  // kGeometry
  std::vector<Vector3> positions_m;
  // kFull
  std::vector<Vector3> displacements_m;
  std::vector<std::array<double, 6>> displacement_covariances_m2;  ///< xx, xy, xz, yy, yz, zz
  std::vector<Vector3> nodal_forces_n;
  std::vector<double> nodal_force_sigmas_n;
  std::vector<MarkerSource> marker_sources;
  double force_residual = 0;
  bool force_converged = true;

  /// From exposure to this client; right as far as both machines' clocks agree. None: a frame without a
  /// picture.
  std::optional<double> latency_s() const {
    if (times.exposure_utc_ns == 0) return {};
    return static_cast<double>(times.client_utc_ns - times.exposure_utc_ns) * 1e-9;
  }
};

struct StreamOptions {
  std::vector<std::string> links = {};  ///< empty: all
  Detail detail = Detail::kContacts;
  double max_rate_hz = 0;  ///< of each link; 0: all frames
  Delivery delivery = Delivery::kLatest;
};

/// As the server counts them since the stream began.
struct StreamCounts {
  std::string link;
  uint64_t frames_sent = 0;
  uint64_t frames_dropped = 0;  ///< because this client was too slow
};

struct CalibrateOptions {
  std::string link;
  int pairs = 8;       ///< rest pairs to average over
  bool save = false;   ///< also write the link's configured calibration file on the server
  bool force = false;  ///< even if the newest frame shows contacts
};

/// How well a link's cameras fit its rest markers. RMS.
struct CalibrationResult {
  int markers_used = 0;  ///< seen by both cameras
  double rms_px = 0;     ///< of the reprojection, each axis
  double rmse_r_m = 0, rmse_tangential_m = 0, rmse_z_m = 0;
  std::string file_text;  ///< of the calibration file (YAML)
  std::string saved_to;   ///< on the server; empty: nowhere
};

/// Pairs taken so far, and wanted. False: cancel.
using CalibrateProgress = std::function<bool(int taken, int wanted)>;

/// A running stream; ends when destroyed. Next from one thread, Cancel from any.
class FrameReader {
 public:
  ~FrameReader();
  FrameReader(const FrameReader&) = delete;
  FrameReader& operator=(const FrameReader&) = delete;

  /// Waits for the next frame. Errors: kTimeout (call again), kEndOfData (cancelled), kUnavailable (server
  /// ended the stream or is gone, with the reason), or what the server refused the request with.
  Result<Frame> Next(std::chrono::milliseconds timeout);

  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

  /// As of the last time that the server told them (at most once a second, when frames were dropped).
  const std::vector<StreamCounts>& counts() const;

 private:
  friend class Client;
  struct Call;
  explicit FrameReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

/// A connection to one server.
class Client {
 public:
  /// Errors: kUnavailable (no server there within `timeout`, with what to do).
  static Result<Client> Connect(const std::string& address,
                                std::chrono::milliseconds timeout = std::chrono::seconds(3));
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  Result<Arm> GetArm(std::chrono::milliseconds timeout = std::chrono::seconds(10));

  /// Returns once the server has accepted. Errors: kNotFound (no such link), kInvalidArgument,
  /// kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<FrameReader>> StreamFrames(
      const StreamOptions& options, std::chrono::milliseconds timeout = std::chrono::seconds(10));

  /// Finds the link's cameras and rest shape anew; nothing may touch the skin. Waits for the end. Errors:
  /// kNotFound, kFailedPrecondition (touched, moved, does not fit: the message says), kUnavailable,
  /// kEndOfData (cancelled); then the link stays as it was.
  Result<CalibrationResult> Calibrate(const CalibrateOptions& options, const CalibrateProgress& progress = {},
                                      std::chrono::milliseconds timeout = std::chrono::seconds(60));

 private:
  struct Connection;
  explicit Client(std::shared_ptr<Connection> connection);

  std::shared_ptr<Connection> connection_;
};

}  // namespace taclink::client
