#include "server/rpc/arm_message.h"

#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

v1::SourceKind ToWire(SourceKind kind) {
  switch (kind) {
    case SourceKind::kV4l2:
      return v1::SOURCE_KIND_V4L2;
    case SourceKind::kFiles:
      return v1::SOURCE_KIND_FILES;
    case SourceKind::kSimulated:
      return v1::SOURCE_KIND_SIMULATED;
  }
  return v1::SOURCE_KIND_UNSPECIFIED;
}

void FillSource(SourceKind kind, const SourceInfo& info, v1::Source& out) {
  out.set_kind(ToWire(kind));
  out.set_description(info.description);
  out.set_width_px(static_cast<uint32_t>(info.width_px));
  out.set_height_px(static_cast<uint32_t>(info.height_px));
  out.set_frame_rate_hz(info.frame_rate_hz);
}

void FillStatistics(const LinkStatistics& statistics, uint64_t restarts, v1::LinkStatistics& out) {
  out.set_rate_hz(statistics.rate_hz);
  out.set_latency_p50_s(statistics.latency_p50_ms * wire::kSecondsPerMs);
  out.set_latency_p99_s(statistics.latency_p99_ms * wire::kSecondsPerMs);
  out.set_frames(statistics.frames);
  out.set_frames_skipped(statistics.frames_skipped);
  out.set_source_restarts(restarts);
}

}  // namespace

void Fill(const Arm& arm, v1::Arm& out) {
  out.set_name(arm.name());
  out.set_server_version(TACLINK_VERSION);
  for (size_t i = 0; i < arm.links().size(); ++i) {
    const LinkDescription& link = arm.links()[i];
    const SourceCondition source = arm.worker(i).source_condition();
    v1::Link& message = *out.add_links();
    message.set_name(link.name);
    message.set_index(static_cast<uint32_t>(i));
    wire::Fill(link.model, *message.mutable_model());
    wire::Fill(link.base_from_link, *message.mutable_base_from_link());
    FillSource(link.source, source.info, *message.mutable_source());
    FillStatistics(arm.worker(i).Statistics(), source.restarts, *message.mutable_statistics());
    message.set_status(v1::LINK_STATUS_STARTING);
    if (const auto latest = arm.hub().Latest(i)) {
      message.set_status(wire::ToWire(latest->state().status));
      message.set_status_reason(latest->state().status_reason);
      message.mutable_statistics()->set_contacts(static_cast<uint32_t>(latest->state().contacts.size()));
    }
  }
}

}  // namespace taclink::server
