#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "taclink/events.h"
#include "taclink/result.h"

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

/// `kAuto` is for SetForceModel only: the cheapest that is good enough, frame by frame.
enum class ForceModel { kUnknown, kLiteral, kLinear, kPressurised, kNonlinear, kAuto };
const char* Name(ForceModel model);

enum class MarkerSource : uint8_t { kUnknown, kBoth, kTop, kBottom, kInferred };

enum class SourceKind { kUnknown, kV4l2, kFiles, kSimulated, kLog };
const char* Name(SourceKind kind);

/// How the worker of a link does: late, being started again, or dead so often that it waits for RestartLink.
enum class Supervision { kUnknown, kRunning, kOverdue, kRestarting, kResting };
const char* Name(Supervision supervision);

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

/// One camera of a link. Counts are since the server started.
struct Camera {
  std::string name;          ///< "top" or "bottom"
  std::string configured;    ///< as the configuration names it
  std::string device;        ///< what was found by that name; empty: not open
  std::string format;        ///< "MJPEG 640x480"; empty: not open
  std::string trouble;       ///< why it gives no pictures; empty: it does
  double rate_hz = 0;        ///< as measured; 0: gives none
  uint64_t pictures = 0;     ///< came whole from the driver
  uint64_t lost = 0;         ///< counted but never handed out by the driver
  uint64_t damaged = 0;      ///< marked bad by the driver, or empty
  uint64_t undecodable = 0;  ///< no picture could be made of it
  uint64_t unpaired = 0;     ///< the other camera had none of that time
  uint64_t stamped_on_arrival = 0;
  // As read when it was opened or set; none: it has no such control, or is not open.
  std::optional<bool> automatic_exposure = {};
  std::optional<double> exposure_s = {};  ///< none also while the camera decides
  std::optional<int> gain = {};           ///< camera's own units
};

/// What is not given stays as it is.
struct CameraSettings {
  bool automatic_exposure = false;        ///< then without exposure_s
  std::optional<double> exposure_s = {};  ///< steps of 0.1 ms
  std::optional<int> gain = {};           ///< camera's own units
};

struct Link {
  std::string name;
  int index = 0;
  LinkModel model;
  Pose base_from_link;  ///< now
  std::string frame;    ///< link of the URDF that it is fixed to; empty: the base
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
  uint64_t pairs_skipped = 0;  ///< of frames_skipped, before the server fetched them
  int contacts = 0;
  std::vector<Camera> cameras;  ///< top, bottom; none: the source has no cameras
  Supervision supervision = Supervision::kUnknown;
  std::string
      supervision_reason;  ///< what is wrong with the worker and what happens next; empty while it runs
  uint64_t worker_restarts = 0;
  uint64_t stage_overruns = 0;                ///< stages of the worker that took longer than they may
  uint64_t workers_abandoned = 0;             ///< that hung
  std::string last_failure;                   ///< why the last worker died; empty: none did
  std::vector<ForceLevelState> force_levels;  ///< of the whole link, then of its regions
  Baseline baseline;
};

/// A joint of the arm's URDF that moves by itself. Positions in rad; prismatic: m.
struct Joint {
  std::string name;
  std::optional<double> lower, upper;  ///< range; none: not limited
  std::optional<double> position;      ///< now, after the newest state; none: the server was told none
  double position_age_s = 0;
};

struct Arm {
  std::string name;
  std::string server_version;
  std::vector<Link> links;
  std::string base_frame = {};     ///< link of the URDF; empty: there is no URDF
  std::vector<Joint> joints = {};  ///< from the base to the tips
};

/// What makes a frame worse than it could be, as v1::Reason; `kUnknown`: another version's, see its id.
enum class Reason {
  kUnknown,
  kFewMarkers,
  kCamera,
  kFrozen,
  kLate,
  kCamerasDisagree,
  kNotConverged,
  kImpossible,
  kNoEquilibrium,
  kPressureUnknown,
  kPressureMismatch,
  kResidual,
  kLabels,
  kTooDeep,
  kBeyondMarkers,
  kEncircled,
  kSparseMarkers,
  kUnsettled,
  kForceModel,
  kCamerasMoved,
  kDrift,
  kNoFrames,
  kWorker,
  kForcedBaseline,
};

/// Why a frame is worse than it could be.
struct StatusReason {
  Reason reason = Reason::kUnknown;
  std::string id;                      ///< its name, such as "pressure_mismatch"
  std::string text;                    ///< for people, with what to do
  std::optional<double> value, limit;  ///< its number, and where it begins to be told; none: it has none
  std::string unit;                    ///< "m", "Pa", "s"; empty: a number of markers, or a ratio
};
/// Gauge pressure that the skin's shape and the sensor tell together, and its standard deviation.
struct PressureEstimate {
  double pressure_pa = 0, sigma_pa = 0;
};

struct Contact {
  uint64_t id = 0;                                  ///< lasts while the contact does
  Vector3 center_m{};                               ///< on the deformed outer surface
  Vector3 normal{};                                 ///< unit, away from the axis
  Vector3 force_n{};                                ///< what the world exerts on the skin
  std::optional<Covariance3> force_covariance_n2;   ///< none: not known
  std::optional<Covariance3> center_covariance_m2;  ///< likewise
  /// Integral of the inward load; nonzero also for a ring contact, whose resultant is about zero.
  double normal_force_n = 0;
  bool is_ring_contact = false;  ///< presses evenly around the whole circumference
  double area_m2 = 0;
  std::vector<int> markers;
  Vector3 moment_nm{};  ///< of the load about the link frame's origin
  double peak_pressure_pa = 0;
  Vector3 major_axis_m{}, minor_axis_m{};  ///< as long as the load's standard deviation along them
  std::vector<Vector3> outline_m;          ///< polygon on the deformed skin; from kGeometry on
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

/// How the pressure inside a skin is known.
struct PressureReport {
  std::string origin = "none";  ///< none, constant, simulated, file, serial, client
  bool assumed = true;          ///< configured, or told by nobody: not measured
  bool stale = false;           ///< the sensor's newest reading is too old, or there is none
  double pressure_pa = 0;       ///< the reading, or what is assumed; gauge
  std::optional<double> age_s;  ///< from the reading to the exposure; none: there is no reading
  std::string trouble;          ///< what is wrong with the sensor; empty: nothing
};

struct Frame {
  std::string link;
  int link_index = 0;
  uint64_t sequence = 0;
  FrameTimes times;
  LinkStatus status = LinkStatus::kUnknown;
  std::string status_reason;
  std::vector<StatusReason> status_reasons;  ///< all of them, the gravest first
  std::optional<double> pressure_pa;         ///< measured
  std::optional<PressureEstimate> pressure_estimate;
  PressureReport pressure;
  int markers_seen = 0;
  int markers_inferred = 0;
  std::vector<Contact> contacts;
  /// Sum of the contacts' forces. None: no forces are known, for nothing is measured or what was found can't
  /// be trusted (status_reason); then there are no contacts either.
  std::optional<Vector3> total_force_n;
  ForceModel force_model = ForceModel::kUnknown;
  double baseline_age_s = 0;
  Baseline baseline;
  StageTimes stage_times;
  bool tracked = false;      ///< markers were followed; else the full pictures were searched
  double picture_share = 0;  ///< part of both pictures' pixels that were read
  bool unchanged = false;    ///< within the stream's deadband; at kContacts
  bool replayed = false;     ///< from a log: the times are those of then
  /// A body that presses less may not be found, N; of all markers the largest. None: no forces are known, or
  /// their model (literal) tells none.
  std::optional<double> detection_limit_n;
  /// The same of what presses alike all around at one place along the link: its sum, where it shows least.
  std::optional<double> detection_limit_around_n;
  /// RMS of what the forces do not explain, in standard deviations. None: no forces are known.
  std::optional<double> force_residual;
  /// How far cameras that have moved or changed since the baseline would put markers off, of the marker that
  /// they put off most; taken off shape and forces. None: no forces are known, or an older version's log.
  std::optional<double> camera_shift_m;

  // kGeometry
  std::vector<Vector3> positions_m;
  // kFull
  std::vector<Vector3> displacements_m;
  std::vector<std::array<double, 6>> displacement_covariances_m2;  ///< xx, xy, xz, yy, yz, zz
  std::vector<Vector3> nodal_forces_n;
  std::vector<double> nodal_force_sigmas_n;
  std::vector<MarkerSource> marker_sources;
  std::vector<double> detection_limits_n;  ///< as detection_limit_n, of each marker
  bool force_converged = true;

  /// From exposure to this client; right as far as both machines' clocks agree. None: a frame without a
  /// picture, or from a log.
  std::optional<double> latency_s() const {
    if (times.exposure_utc_ns == 0 || replayed) return {};
    return static_cast<double>(times.client_utc_ns - times.exposure_utc_ns) * 1e-9;
  }
};

struct StreamOptions {
  std::vector<std::string> links = {};  ///< empty: all
  Detail detail = Detail::kContacts;
  double max_rate_hz = 0;  ///< of each link; 0: all frames
  Delivery delivery = Delivery::kLatest;
  /// A link that changes less is sent once a second only (Frame::unchanged); 0: this does not count, both 0:
  /// all.
  double deadband_force_n = 0;
  double deadband_move_m = 0;
};

/// As the server counts them since the stream began.
struct StreamCounts {
  std::string link;
  uint64_t frames_sent = 0;
  uint64_t frames_dropped = 0;            ///< because this client was too slow
  uint64_t frames_dropped_for_bytes = 0;  ///< of these, because of the bytes that waited, not their number
  uint64_t frames_unchanged = 0;          ///< left out because of the deadband
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

/// How a client knows the server and shows who it is itself. Files are PEM; empty: not used.
struct Credentials {
  std::string ca_file = {};  ///< the server's certificate must be signed by one of these; empty: no TLS
  std::string certificate_file = {};  ///< this client's own, for servers that ask for one
  std::string key_file = {};          ///< of that certificate
  std::string token = {};             ///< goes with every call; never in the clear to another machine
};

/// The default time limit of a call: the larger of `usual` and the seconds in the environment variable
/// TACLINK_PATIENCE_S, for slow machines. If the variable is not a positive number, it is `usual`;
/// Client::Connect has then reported the error.
std::chrono::milliseconds Patience(std::chrono::milliseconds usual);

class Recordings;        // taclink/recordings.h
class ContactReader;     // taclink/arm_contacts.h
class JointStateWriter;  // likewise

/// A connection to one server.
class Client {
 public:
  /// Waits 3 s for a server, and as long as Patience says for one that accepts the connection but is slow.
  /// Errors: kUnavailable (no server there, with what to do), kNotFound (a file), kInvalidArgument
  /// (credentials that can't be used so, or a TACLINK_PATIENCE_S that is not a positive number).
  static Result<Client> Connect(const std::string& address, const Credentials& credentials = {});
  /// As above, but waits for `timeout` in either case.
  static Result<Client> Connect(const std::string& address, std::chrono::milliseconds timeout,
                                const Credentials& credentials = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  Result<Arm> GetArm(std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Returns once the server has accepted. Errors: kNotFound (no such link), kInvalidArgument,
  /// kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<FrameReader>> StreamFrames(
      const StreamOptions& options, std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Gives the link a fresh source and processor, as after the server's start. Returns when it is ordered;
  /// GetArm tells how it goes. Errors: kNotFound, kUnavailable.
  Result<void> RestartLink(const std::string& link,
                           std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// `camera`: "top", "bottom" or empty for both. Holds until the server ends. Errors: kNotFound,
  /// kInvalidArgument (with what the camera takes), kUnsupported (nothing to set), kUnavailable (the camera
  /// is not there now).
  Result<void> SetCamera(const std::string& link, const std::string& camera, const CameraSettings& settings,
                         std::chrono::milliseconds timeout = Patience(std::chrono::seconds(20)));
  /// Computes the link's forces by `model` from the next frame on. Errors: kNotFound, kInvalidArgument,
  /// kFailedPrecondition (kLinear on a skin that may be inflated), kUnavailable.
  Result<void> SetForceModel(const std::string& link, ForceModel model,
                             std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

  /// Finds the link's cameras and rest shape anew; nothing may touch the skin. Waits for the end. Errors:
  /// kNotFound, kFailedPrecondition (touched, moved, does not fit: the message says), kUnavailable,
  /// kEndOfData (cancelled); then the link stays as it was.
  Result<CalibrationResult> Calibrate(const CalibrateOptions& options, const CalibrateProgress& progress = {},
                                      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

  /// The server's recordings; see taclink/recordings.h.
  Recordings RecordingCalls() const;

  /// All contacts of the arm in its base frame. `max_rate_hz` 0: whenever a link publishes. Returns once the
  /// server has accepted. Errors: kInvalidArgument, kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<ContactReader>> StreamContacts(
      double max_rate_hz = 0, std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Begins to tell the server where the joints are. What it refuses is told by the writer.
  std::unique_ptr<JointStateWriter> UpdateJointStates();

  /// Makes what the links show now their baseline; each is accepted or refused for itself. Errors: kNotFound,
  /// kInvalidArgument, kUnavailable.
  Result<std::vector<LinkTare>> Tare(const TareRequest& request,
                                     std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

  /// `region` empty: the whole link. Errors: kNotFound (no such link or region), kInvalidArgument.
  Result<ForceLevelState> SetThresholds(
      const std::string& link, const std::string& region, const Thresholds& thresholds,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

  /// Returns once the server has accepted. Errors: as StreamFrames.
  Result<std::unique_ptr<EventReader>> StreamEvents(
      const EventOptions& options, std::chrono::milliseconds timeout = Patience(std::chrono::seconds(10)));

 private:
  friend class JointStateWriter;
  struct Connection;
  friend class EventReader;
  explicit Client(std::shared_ptr<Connection> connection);

  std::shared_ptr<Connection> connection_;
};

}  // namespace taclink::client
