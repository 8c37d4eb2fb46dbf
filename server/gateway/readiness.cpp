#include "server/gateway/readiness.h"

namespace taclink::server {

Readiness CheckReadiness(const Arm& arm) {
  Readiness out;
  std::string not_ready;
  for (size_t link = 0; link < arm.links().size(); ++link) {
    const auto latest = arm.hub().Latest(link);
    const LinkStatus status = latest ? latest->state().status : LinkStatus::kStarting;
    if (status != LinkStatus::kStarting && status != LinkStatus::kLost) {
      out.ready = true;
      continue;
    }
    not_ready +=
        "link " + arm.links()[link].name + ": " + (status == LinkStatus::kLost ? "lost" : "starting");
    if (latest && !latest->state().status_reason.empty()) not_ready += ", " + latest->state().status_reason;
    not_ready += "\n";
  }
  out.text = (out.ready ? "ready\n" : "not ready: no link has frames\n") + not_ready;
  return out;
}

}  // namespace taclink::server
