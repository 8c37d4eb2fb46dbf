#include "server/arm.h"

#include <utility>

namespace taclink::server {

Arm::Arm(std::string name, std::vector<LinkParts> links, FrameEncoder encoder, Clock& clock,
         LinkWorkerOptions options)
    : name_(std::move(name)), hub_(links.size(), std::move(encoder)) {
  for (LinkParts& parts : links) {
    const size_t link = links_.size();
    links_.push_back(std::move(parts.description));
    workers_.push_back(std::make_unique<LinkWorker>(link, links_.back().name, std::move(parts.source),
                                                    std::move(parts.processor), hub_, clock, options));
  }
}

void Arm::Start() {
  for (const auto& worker : workers_) worker->Start();
}

void Arm::Stop() {
  for (const auto& worker : workers_) worker->RequestStop();  // all at once, then wait for each
  for (const auto& worker : workers_) worker->Stop();
}

}  // namespace taclink::server
