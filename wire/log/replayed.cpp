#include "wire/log/replayed.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include "taclink/v1/recording.pb.h"
#include "wire/convert.h"
#include "wire/frame_codec.h"

namespace taclink::wire::log {
namespace {

using v1::ReplayResponse;

// 0: such messages are not replayed.
uint32_t FieldOf(TopicKind kind) {
  switch (kind) {
    case TopicKind::kFrame:
      return ReplayResponse::kFrameFieldNumber;
    case TopicKind::kContacts:
      return ReplayResponse::kContactsFieldNumber;
    case TopicKind::kEvents:
      return ReplayResponse::kEventFieldNumber;
    case TopicKind::kArm:
      return ReplayResponse::kArmFieldNumber;
    case TopicKind::kLosses:
      return ReplayResponse::kLossFieldNumber;
    default:
      return 0;
  }
}

template <typename T>
bool Parse(mcap::Bytes data, T& out) {
  return out.ParseFromArray(data.data(), static_cast<int>(data.size()));
}

Error NoMessage(const char* type) {
  return {ErrorCode::kInvalidArgument, std::string("a message of the log is no ") + type};
}

// A message field that holds `data` and then `tail`, and the time of the log.
std::string Wrap(uint32_t field, std::string_view data, std::string_view tail, int64_t log_utc_ns) {
  constexpr uint32_t kVarint = 0, kLengthDelimited = 2;
  std::string out;
  out.reserve(data.size() + tail.size() + 32);
  {
    google::protobuf::io::StringOutputStream stream(&out);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.WriteTag(field << 3 | kLengthDelimited);
    coded.WriteVarint32(static_cast<uint32_t>(data.size() + tail.size()));
    coded.WriteRaw(data.data(), static_cast<int>(data.size()));
    coded.WriteRaw(tail.data(), static_cast<int>(tail.size()));
    coded.WriteTag(uint32_t{ReplayResponse::kLogUtcNsFieldNumber} << 3 | kVarint);
    coded.WriteVarint64(static_cast<uint64_t>(log_utc_ns));
  }
  return out;
}

void Strip(Detail detail, v1::LinkFrame& frame) {
  if (wire::FromWire(frame.detail()) > detail) frame.set_detail(ToWire(detail));
  frame.set_replayed(true);
  frame.clear_displacements_m();
  frame.clear_displacement_covariances_m2();
  frame.clear_nodal_forces_n();
  frame.clear_nodal_force_sigmas_n();
  frame.clear_marker_sources();
  frame.clear_detection_limits_n();
  frame.clear_force_not_converged();
  if (detail != Detail::kContacts) return;
  frame.clear_positions_m();
  for (v1::Contact& contact : *frame.mutable_contacts()) contact.clear_outline_m();
}

void ClearForces(v1::LinkFrame& frame) {
  frame.clear_total_force_n();
  frame.clear_nodal_forces_n();
  frame.clear_nodal_force_sigmas_n();
  frame.clear_force_residual();
  frame.clear_camera_shift_m();
}

template <typename T>
Result<bool> IsOf(mcap::Bytes data, const std::set<std::string>& links, const char* type) {
  T message;
  if (!Parse(data, message)) return NoMessage(type);
  return message.link().empty() || links.contains(message.link());
}

}  // namespace

Result<std::optional<std::string>> EncodeReplayed(TopicKind kind, mcap::Bytes data, int64_t log_utc_ns,
                                                  const ReplayedForm& form) {
  const uint32_t field = FieldOf(kind);
  if (field == 0) return Error{ErrorCode::kInvalidArgument, "messages of this topic are not replayed"};
  if (!form.links.empty() && (kind == TopicKind::kEvents || kind == TopicKind::kLosses)) {
    const auto is_of = kind == TopicKind::kEvents
                           ? IsOf<v1::Event>(data, form.links, "Event")
                           : IsOf<v1::RecordingLoss>(data, form.links, "RecordingLoss");
    if (!is_of) return is_of.error();
    if (!*is_of) return std::optional<std::string>();
  }
  const std::string mark = kind == TopicKind::kFrame ? ReplayedMark() : std::string();
  if (kind != TopicKind::kFrame) return std::optional(Wrap(field, mcap::AsText(data), mark, log_utc_ns));
  thread_local v1::LinkFrame frame;  // keeps its arrays from frame to frame
  if (!Parse(data, frame)) return NoMessage("LinkFrame");
  const bool has_zeros = frame.force_not_converged() && frame.has_total_force_n();  // in older logs
  if (form.detail == Detail::kFull && !has_zeros)
    return std::optional(Wrap(field, mcap::AsText(data), mark, log_utc_ns));
  if (has_zeros) ClearForces(frame);
  if (form.detail != Detail::kFull)
    Strip(form.detail, frame);
  else
    frame.set_replayed(true);
  return std::optional(Wrap(field, frame.SerializeAsString(), "", log_utc_ns));
}

}  // namespace taclink::wire::log
