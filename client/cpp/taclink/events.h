#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "taclink/result.h"

/// Taring, force thresholds and events of a TacLINK server. SI units, link frame.
namespace taclink::client {

/// How the shape was taken against which displacements are measured.
enum class BaselineOrigin { kUnknown, kStart, kCalibration, kTare, kForcedTare };
const char* Name(BaselineOrigin origin);  ///< "start", "forced tare", ...

struct Baseline {
  BaselineOrigin origin = BaselineOrigin::kUnknown;  ///< kUnknown: there is none
  int64_t taken_utc_ns = 0;                          ///< since 1970-01-01
  double drift_m = 0;      ///< how far it has followed the skin since, of the marker that went furthest
  bool following = false;  ///< now: nothing touches
};

struct TareRequest {
  std::vector<std::string> links = {};  ///< empty: all
  bool force = false;                   ///< even while touched, moved or with few markers
  int frames = 10;                      ///< to average over
};

struct LinkTare {
  std::string link;
  bool accepted = false;
  std::string reason;  ///< why not, and what to do
  bool forced = false;
  int frames = 0;
  double shift_m = 0;         ///< against the old baseline, of the marker that is furthest off
  double previous_age_s = 0;  ///< of the old baseline
};

enum class ForceLevel { kUnknown, kNormal, kWarning, kAlarm };
const char* Name(ForceLevel level);

/// 0: no such level.
struct Thresholds {
  double warning_n = 0, alarm_n = 0, hysteresis_n = 0.05;
};

/// How a link, or a configured region of it, stands.
struct ForceLevelState {
  std::string region;  ///< empty: the whole link
  Thresholds thresholds;
  ForceLevel level = ForceLevel::kUnknown;
  double force_n = 0;  ///< of the strongest contact there
};

enum class EventKind {
  kUnknown,
  kContactBegin,
  kContactUpdate,
  kContactEnd,
  kForceLevel,
  kLinkStatus,
  kTare,
  kCalibration,
  kBaseline,
  kDrift,
  kThresholds,
  kFramesLost,
  kRecording,
  kForceModel,
  kCamera,
};
const char* Name(EventKind kind);  ///< "contact_begin", ...
std::optional<EventKind> EventKindOf(const std::string& name);

/// What happened. Only the fields of its kind are set.
struct Event {
  uint64_t sequence = 0;  ///< in this run of the server
  EventKind kind = EventKind::kUnknown;
  std::string link;  ///< empty: the whole arm
  uint64_t frame_sequence = 0;
  int64_t exposure_utc_ns = 0, exposure_ns = 0, published_ns = 0, raised_ns = 0;
  int64_t raised_utc_ns = 0, sent_utc_ns = 0;
  int64_t client_utc_ns = 0;  ///< this client had it; 0: it comes from a log

  // Contacts and force levels.
  uint64_t contact_id = 0;
  std::array<double, 3> center_m{}, force_vector_n{};
  double force_n = 0;
  // Contacts.
  double peak_force_n = 0, duration_s = 0;
  std::string end_reason;
  // Force levels.
  std::string region;
  ForceLevel level = ForceLevel::kUnknown, previous_level = ForceLevel::kUnknown;
  Thresholds thresholds;
  // Link status.
  std::string status, previous_status;  ///< "ok", "lost", ...
  std::string reason;
  // Tare, calibration, baseline, thresholds.
  std::string who, outcome;
  bool accepted = false;
  std::map<std::string, double> values;
  // Drift.
  double drift_m = 0;
  // Frames lost.
  uint64_t frames = 0;

  /// From the exposure of the frame that made it to this client; right as far as both clocks agree.
  std::optional<double> latency_s() const {
    if (exposure_utc_ns == 0 || client_utc_ns == 0) return {};
    return static_cast<double>(client_utc_ns - exposure_utc_ns) * 1e-9;
  }
};

/// A place in the events of a server's run.
struct EventPlace {
  std::string run_id;
  uint64_t after_sequence = 0;
};

struct EventOptions {
  std::vector<std::string> links = {};  ///< empty: all
  std::vector<EventKind> kinds = {};    ///< empty: all
  std::optional<EventPlace> resume =
      {};  ///< none: from now on; an empty place: all that the server still has
};

/// A running stream of events; ends when destroyed. Next from one thread, Cancel from any.
class EventReader {
 public:
  ~EventReader();
  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  /// Waits for the next event. Errors: kTimeout (call again), kEndOfData (cancelled), kUnavailable (server
  /// ended the stream or is gone: connect again, with `place`).
  Result<Event> Next(std::chrono::milliseconds timeout);
  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

  /// Where to resume; moves on each second, also without events.
  const EventPlace& place() const;
  /// Events that had left the server's history before they could be sent, since the stream began.
  uint64_t events_lost() const;
  /// The server was started anew since `resume`: what happened at the end of its former run is unknown.
  bool run_changed() const;
  uint64_t newest_sequence() const;

 private:
  friend class Client;
  struct Call;
  explicit EventReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

}  // namespace taclink::client
