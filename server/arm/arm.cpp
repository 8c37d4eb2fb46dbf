#include "server/arm/arm.h"

#include <utility>

#include "sensing/core/similar_skin.h"
#include "server/arm/link_names.h"
#include "server/pressure/pressure_controller.h"

namespace taclink::server {
namespace {

std::unique_ptr<AcceptanceStore> MakeAcceptances(const std::vector<LinkDescription>& links, const Hub& hub,
                                                 const std::string& folder, Clock& clock) {
  std::vector<AcceptedLink> accepted;
  for (size_t link = 0; link < links.size(); ++link) {
    accepted.push_back({.name = links[link].name,
                        .model = links[link].model,
                        .model_hash = links[link].model_hash,
                        .recorded = links[link].acceptance,
                        .calibrated_utc_ns = [&hub, link]() -> int64_t {
                          const auto newest = hub.Latest(link);
                          return newest ? newest->state().baseline.calibrated_utc_ns : 0;
                        }});
  }
  return std::make_unique<AcceptanceStore>(std::move(accepted), folder, clock);
}

// Not accepted: the server closed the valve of its own accord.
Operation ToOperation(const PressureTrip& trip) {
  Operation operation{.who = "server", .accepted = false, .outcome = trip.text, .values = {}};
  const double scale = TripUnitInSi(trip.cause);
  if (trip.measured) operation.values["measured"] = scale * *trip.measured;
  if (trip.limit) operation.values["limit"] = scale * *trip.limit;
  return operation;
}

}  // namespace

Arm::Arm(std::string name, std::vector<LinkParts> links, FrameEncoder encoder, Clock& clock,
         const ArmOptions& options, std::unique_ptr<ArmPoses> poses)
    : name_(std::move(name)),
      clock_(clock),
      poses_(std::move(poses)),
      hub_(links.size(), std::move(encoder)),
      watchdog_(clock, options.watchdog.interval) {
  if (!poses_) {
    std::vector<LinkMount> mounts;
    for (const LinkParts& parts : links)
      mounts.push_back({.frame = {}, .frame_from_link = parts.description.base_from_link});
    poses_ = std::make_unique<ArmPoses>(std::move(mounts));
  }
  contacts_ = std::make_unique<ArmContacts>(*poses_);
  std::vector<WatchedLink> watched;
  for (LinkParts& parts : links) {
    const size_t link = links_.size();
    links_.push_back(std::move(parts.description));
    const LinkModel& model = links_.back().model;
    watched.push_back({links_.back().name, links_.back().rules, model.markers, LengthUnit(model)});
    pressures_.push_back(parts.pressure ? std::move(parts.pressure) : MakeAssumedPressure(std::nullopt));
    attitudes_.push_back(parts.attitude ? std::move(parts.attitude) : MakeSourceAttitude());
    simulations_.push_back(std::move(parts.simulation));
    LinkWorkerOptions worker = options.worker;
    worker.realtime = parts.realtime;
    worker.pressure = pressures_.back();
    worker.attitude = attitudes_.back();
    workers_.push_back(std::make_unique<LinkSupervisor>(
        link, links_.back().name, std::move(parts.source), std::move(parts.processor),
        std::move(parts.factories), hub_, clock, worker, options.watchdog));
  }
  acceptances_ = MakeAcceptances(links_, hub_, options.acceptance_folder, clock);
  events_ = std::make_unique<EventEngine>(hub_, std::move(watched), options.events, clock);
  for (size_t link = 0; link < links_.size(); ++link) {
    const auto controller = regulator(link);
    if (!controller) continue;
    (*controller)->OnTrip([this, link](const PressureTrip& trip) {
      events_->Post(EventKind::kPressureTrip, link, ToOperation(trip));
    });
  }
}

std::vector<std::string> Arm::link_names() const {
  std::vector<std::string> names;
  for (const LinkDescription& link : links_) names.push_back(link.name);
  return names;
}

Result<std::shared_ptr<SimulationDesk>> Arm::simulation(size_t link) const {
  if (simulations_[link] != nullptr) return simulations_[link];
  return Error{ErrorCode::kFailedPrecondition,
               "link '" + links_[link].name + "' is not simulated: only simulated links can be handled"};
}

Result<size_t> Arm::FindLink(const std::string& name) const {
  return server::FindLink(link_names(), name);
}

void Arm::Start() {
  events_->Start();
  for (const auto& pressure : pressures_) pressure->Start();
  std::vector<LinkSupervisor*> workers;
  for (const auto& worker : workers_) {
    worker->Start();
    workers.push_back(worker.get());
  }
  watchdog_.Start(std::move(workers));
}

void Arm::Stop() {
  // Before anything that may take long: skins are vented while there is somebody to say so.
  for (size_t link = 0; link < links_.size(); ++link)
    if (const auto controller = regulator(link)) (*controller)->Stop();
  watchdog_.Stop();
  for (const auto& worker : workers_) worker->RequestStop();  // all at once, then wait for each
  for (const auto& worker : workers_) worker->Stop();
  for (const auto& pressure : pressures_) pressure->Stop();
  events_->Stop();
}

}  // namespace taclink::server
