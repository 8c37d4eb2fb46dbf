#include "server/gateway/readiness.h"

namespace taclink::server {

Readiness CheckReadiness(const Arm& arm, const Security& security) {
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
  // Anybody may read this: the log names the files.
  const SecurityStatus access = security.Status();
  const bool measures = out.ready;
  out.ready = measures && !access.refuses_all;
  out.text = out.ready  ? "ready\n"
             : measures ? "not ready: no token is good\n"
                        : "not ready: no link has frames\n";
  out.text += not_ready;
  if (!access.trouble.empty())
    out.text += access.refuses_all ? "security: nobody is let in, for no token is good; the log says why\n"
                                   : "security: tokens or certificates can't be reloaded; the log says why\n";
  return out;
}

}  // namespace taclink::server
