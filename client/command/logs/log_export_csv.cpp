#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "client/command/cli/csv.h"
#include "client/command/logs/log_export.h"
#include "client/command/logs/log_output.h"
#include "client/command/logs/log_visitor.h"

namespace taclink::command {
namespace {

// `utc_ns` is the log time; exposure_utc_ns is empty where no picture was taken.
constexpr const char* kContactColumns =
    "utc_ns,exposure_utc_ns,link,sequence,status,contact_id,center_x_m,center_y_m,center_z_m,normal_x,normal_"
    "y,normal_z,"
    "force_x_n,force_y_n,force_z_n,normal_force_n,force_sigma_x_n,force_sigma_y_n,force_sigma_z_n,area_m2";
constexpr const char* kFrameColumns =
    "utc_ns,exposure_utc_ns,link,sequence,status,status_reason,pressure_pa,total_force_x_n,total_force_y_n,"
    "total_force_z_n,contacts,latency_s,markers_seen,markers_inferred,force_model,tracking_mode,baseline_age_"
    "s,"
    "force_residual,camera_shift_m";
constexpr const char* kEventColumns =
    "utc_ns,raised_utc_ns,exposure_utc_ns,sequence,kind,link,frame_sequence,contact_id,center_x_m,center_y_m,"
    "center_z_m,"
    "normal_x,normal_y,normal_z,force_x_n,force_y_n,force_z_n,normal_force_n,peak_force_n,duration_s,end_"
    "reason,region,"
    "level,previous_level,strongest_force_n,status,previous_status,who,accepted,text,drift_m,drift_step_m,"
    "frames_lost";
constexpr const char* kJointColumns =
    "utc_ns,sample_utc_ns,joint,position_rad_or_m,velocity_rad_per_s_or_m_per_s";

/// Cells of a row that have no value.
struct Blank {
  int cells = 1;
};

/// A time that is not known where it is 0.
struct TimeNs {
  int64_t value = 0;
};

class Table {
 public:
  static Result<std::unique_ptr<Table>> Create(const std::string& path, const char* columns) {
    auto out = OutputText::Create(path);
    if (!out) return out.error();
    std::unique_ptr<Table> table(new Table(std::move(*out)));
    if (const auto written = table->out_->Write(std::string(columns) + "\n"); !written)
      return written.error();
    return table;
  }

  template <typename... T>
  Result<void> Row(const T&... values) {
    row_.clear();
    (Add(values), ...);
    row_.back() = '\n';  // in place of the last comma
    ++rows_;
    return out_->Write(row_);
  }

  Result<void> Finish() { return out_->Finish(); }
  void Print() const { fmt::print("{}: {} rows\n", out_->path(), rows_); }

 private:
  explicit Table(std::unique_ptr<OutputText> out) : out_(std::move(out)) {}

  void Add(const std::string& text) { row_ += CsvCell(text) + ","; }
  void Add(Blank blank) { row_.append(static_cast<size_t>(blank.cells), ','); }
  void Add(std::optional<int> value) { value ? Add(*value) : Add(Blank{}); }
  void Add(TimeNs time) { time.value == 0 ? Add(Blank{}) : Add(time.value); }
  void Add(bool value) { row_ += value ? "true," : "false,"; }
  void Add(std::integral auto value) { row_ += fmt::format("{},", value); }
  void Add(double value) { row_ += std::isfinite(value) ? fmt::format("{},", value) : ","; }
  void Add(const v1::Vector3& vector) {
    Add(vector.x());
    Add(vector.y());
    Add(vector.z());
  }

  const std::unique_ptr<OutputText> out_;
  std::string row_;
  uint64_t rows_ = 0;
};

// Not finite: the cell stays empty.
v1::Vector3 NoVector() {
  v1::Vector3 vector;
  vector.set_x(NAN);
  vector.set_y(NAN);
  vector.set_z(NAN);
  return vector;
}

std::string Text(v1::LinkStatus status) {
  return EnumText(v1::LinkStatus_Name(status), "LINK_STATUS_", status);
}
std::string Text(v1::ForceLevel level) {
  return EnumText(v1::ForceLevel_Name(level), "FORCE_LEVEL_", level);
}

v1::Vector3 Sigmas(const v1::Contact& contact) {
  v1::Vector3 sigmas = NoVector();
  constexpr int kXx = 0, kYy = 3, kZz = 5, kEntries = 6;
  if (contact.force_covariance_n2_size() != kEntries) return sigmas;
  sigmas.set_x(std::sqrt(contact.force_covariance_n2(kXx)));
  sigmas.set_y(std::sqrt(contact.force_covariance_n2(kYy)));
  sigmas.set_z(std::sqrt(contact.force_covariance_n2(kZz)));
  return sigmas;
}

Result<void> AddContacts(Table& out, const v1::LinkFrame& frame, int64_t utc_ns) {
  for (const v1::Contact& contact : frame.contacts()) {
    const auto added =
        out.Row(utc_ns, TimeNs{frame.times().exposure_utc_ns()}, frame.link(), frame.sequence(),
                Text(frame.status()), contact.id(), contact.center_m(), contact.normal(), contact.force_n(),
                contact.normal_force_n(), Sigmas(contact), contact.area_m2());
    if (!added) return added;
  }
  return {};
}

Result<void> AddFrame(Table& out, const v1::LinkFrame& frame, int64_t utc_ns) {
  const v1::FrameTimes& times = frame.times();
  const bool exposed = times.exposure_ns() != 0 && times.published_ns() != 0;
  return out.Row(
      utc_ns, TimeNs{times.exposure_utc_ns()}, frame.link(), frame.sequence(), Text(frame.status()),
      frame.status_reason(), frame.has_pressure_pa() ? frame.pressure_pa() : NAN,
      IsMeasured(frame) ? frame.total_force_n() : NoVector(),
      IsMeasured(frame) ? std::optional(frame.contacts_size()) : std::nullopt,
      exposed ? static_cast<double>(times.published_ns() - times.exposure_ns()) * 1e-9 : NAN,
      frame.markers_seen(), frame.markers_inferred(),
      EnumText(v1::ForceModel_Name(frame.force_model()), "FORCE_MODEL_", frame.force_model()),
      EnumText(v1::TrackingMode_Name(frame.tracking_mode()), "TRACKING_MODE_", frame.tracking_mode()),
      frame.baseline_age_s(), frame.has_force_residual() ? frame.force_residual() : NAN,
      frame.has_camera_shift_m() ? frame.camera_shift_m() : NAN);
}

// Groups of columns that an event of another kind leaves empty; they follow one another in this order.
constexpr Blank kNoPlace{4};  // contact_id, center
constexpr Blank kNoContactForce{10};
constexpr Blank kNoLevel{4};
constexpr Blank kNoStatus{2};
constexpr Blank kNoAnswer{2};  // who, accepted
constexpr Blank kNoText{1};
constexpr Blank kNoDrift{2};
constexpr Blank kNoLoss{1};

Result<void> AddEventRow(Table& out, const v1::Event& event, int64_t utc_ns, const auto&... detail) {
  return out.Row(utc_ns, event.times().raised_utc_ns(), TimeNs{event.times().exposure_utc_ns()},
                 event.sequence(), EnumText(v1::EventKind_Name(event.kind()), "EVENT_KIND_", event.kind()),
                 event.link(), event.frame_sequence(), detail...);
}

Result<void> AddEvent(Table& out, const v1::Event& event, int64_t utc_ns) {
  const auto row = [&](const auto&... detail) { return AddEventRow(out, event, utc_ns, detail...); };
  switch (event.detail_case()) {
    case v1::Event::kContact: {
      const v1::ContactEvent& c = event.contact();
      return row(c.contact_id(), c.center_m(), c.normal(), c.force_n(), c.normal_force_n(), c.peak_force_n(),
                 c.duration_s(), c.end_reason(), kNoLevel, kNoStatus, kNoAnswer, kNoText, kNoDrift, kNoLoss);
    }
    case v1::Event::kForceLevel: {
      const v1::ForceLevelEvent& l = event.force_level();
      return row(l.contact_id(), l.center_m(), kNoContactForce, l.region(), Text(l.level()),
                 Text(l.previous()), l.force_n(), kNoStatus, kNoAnswer, kNoText, kNoDrift, kNoLoss);
    }
    case v1::Event::kLinkStatus: {
      const v1::LinkStatusEvent& s = event.link_status();
      return row(kNoPlace, kNoContactForce, kNoLevel, Text(s.status()), Text(s.previous()), kNoAnswer,
                 s.reason(), kNoDrift, kNoLoss);
    }
    case v1::Event::kOperation: {
      const v1::OperationEvent& o = event.operation();
      return row(kNoPlace, kNoContactForce, kNoLevel, kNoStatus, o.who(), o.accepted(), o.outcome(), kNoDrift,
                 kNoLoss);
    }
    case v1::Event::kDrift:
      return row(kNoPlace, kNoContactForce, kNoLevel, kNoStatus, kNoAnswer, kNoText, event.drift().drift_m(),
                 event.drift().step_m(), kNoLoss);
    case v1::Event::kFramesLost:
      return row(kNoPlace, kNoContactForce, kNoLevel, kNoStatus, kNoAnswer, kNoText, kNoDrift,
                 event.frames_lost().frames());
    case v1::Event::DETAIL_NOT_SET:
      break;
  }
  return row(kNoPlace, kNoContactForce, kNoLevel, kNoStatus, kNoAnswer, kNoText, kNoDrift, kNoLoss);
}

Result<void> AddJoints(Table& out, const v1::JointSample& sample, int64_t utc_ns) {
  for (int i = 0; i < std::min(sample.names_size(), sample.positions_size()); ++i) {
    const double velocity = i < sample.velocities_size() ? sample.velocities(i) : NAN;
    const auto added = out.Row(utc_ns, sample.utc_ns(), sample.names(i), sample.positions(i), velocity);
    if (!added) return added;
  }
  return {};
}

}  // namespace

Result<void> ExportCsv(LogSource& source, const LogPart& part, const std::string& folder) {
  auto contacts = Table::Create(folder + "/contacts.csv", kContactColumns);
  if (!contacts) return contacts.error();
  auto frames = Table::Create(folder + "/frames.csv", kFrameColumns);
  if (!frames) return frames.error();
  auto events = Table::Create(folder + "/events.csv", kEventColumns);
  if (!events) return events.error();
  auto joints = Table::Create(folder + "/joints.csv", kJointColumns);
  if (!joints) return joints.error();
  LogVisitor visitor;
  visitor.frame = [&](const v1::LinkFrame& frame, int64_t utc_ns) {
    const auto added = AddContacts(**contacts, frame, utc_ns);
    return added ? AddFrame(**frames, frame, utc_ns) : added;
  };
  visitor.event = [&](const v1::Event& event, int64_t utc_ns) { return AddEvent(**events, event, utc_ns); };
  visitor.joints = [&](const v1::JointSample& sample, int64_t utc_ns) {
    return AddJoints(**joints, sample, utc_ns);
  };
  if (const auto visited = Visit(source, part, visitor); !visited) return visited;
  for (const auto* table : {&*contacts, &*frames, &*events, &*joints}) {
    if (const auto finished = (*table)->Finish(); !finished) return finished;
  }
  for (const auto* table : {&*contacts, &*frames, &*events, &*joints}) (*table)->Print();
  return {};
}

}  // namespace taclink::command
