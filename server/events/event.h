#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_state.h"
#include "server/config/options.h"

namespace taclink::server {

enum class EventKind : uint8_t {
  kContactBegin,
  kContactUpdate,
  kContactEnd,
  kForceLevel,
  kLinkStatus,
  kTare,
  kCalibration,
  kBaseline,  ///< taken by the link itself, from its first pictures
  kDrift,
  kThresholds,
  kFramesLost,    ///< the engine was too slow: what happened in them is not told
  kRecording,     ///< begun, ended, in trouble
  kForceModel,    ///< set
  kCamera,        ///< exposure or gain set
  kClockStepped,  ///< UTC was set, or the machine was suspended
  kPressureTrip,  ///< of the pressure regulator: its valve was closed, or it was reset
  kAcceptance,    ///< started or finished
};
inline constexpr size_t kEventKinds = 17;

struct ContactDetail {
  uint64_t id = 0;  ///< the contact's in the frame that began it; lasts
  Vec3 center_mm = Vec3::Zero(), normal = Vec3::Zero(), force_n = Vec3::Zero();
  double normal_force_n = 0;
  double peak_n = 0;       ///< largest magnitude until now
  double duration_s = 0;   ///< since it began
  std::string end_reason;  ///< of an end: "released" or "new baseline"
};

struct ForceLevelDetail {
  std::string region;  ///< empty: the whole link
  ForceLevel level = ForceLevel::kNormal, previous = ForceLevel::kNormal;
  double force_n = 0;       ///< magnitude of the strongest contact there
  Thresholds thresholds;    ///< that were in force
  uint64_t contact_id = 0;  ///< in the frame; 0: none
  Vec3 center_mm = Vec3::Zero();
};

struct StatusDetail {
  LinkStatus status = LinkStatus::kStarting, previous = LinkStatus::kStarting;
  std::string reason;
};

/// Something that was asked for: by whom, and what came of it. SI units, named in the keys of `values`.
struct Operation {
  std::string who;
  bool accepted = true;
  std::string outcome;
  std::map<std::string, double> values;
};

struct DriftDetail {
  double drift_mm = 0;
  double step_mm = 0;  ///< since the event before
};

struct FramesLostDetail {
  uint64_t frames = 0;
};

struct Event {
  uint64_t sequence = 0;  ///< from 1, without gaps, by the history
  EventKind kind = EventKind::kContactBegin;
  std::optional<size_t> link;  ///< none: the whole arm
  uint64_t frame_sequence = 0;
  std::optional<LinkStatus> frame_status;        ///< none: no frame made it
  std::vector<ReasonId> frame_reasons;           ///< of that frame
  int64_t exposure_utc_ns = 0, exposure_ns = 0;  ///< of the frame; 0: no frame made it
  int64_t published_ns = 0;                      ///< of the frame, monotonic; 0: likewise
  int64_t raised_ns = 0, raised_utc_ns = 0;      ///< the engine made it
  std::variant<std::monostate, ContactDetail, ForceLevelDetail, StatusDetail, Operation, DriftDetail,
               FramesLostDetail>
      detail;
};
using EventPtr = std::shared_ptr<const Event>;

const char* Name(EventKind kind);  ///< "contact_begin", ...

}  // namespace taclink::server
