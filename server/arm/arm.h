#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_model.h"
#include "server/acceptance/acceptance_store.h"
#include "server/arm/arm_contacts.h"
#include "server/arm/arm_poses.h"
#include "server/attitude/attitude_source.h"
#include "server/events/event_engine.h"
#include "server/hub/hub.h"
#include "server/link/link_supervisor.h"
#include "server/link/link_worker.h"
#include "server/link/watchdog.h"
#include "server/pressure/pressure_source.h"
#include "server/simulation/simulation_desk.h"

namespace taclink::server {

enum class SourceKind { kV4l2, kFiles, kSimulated, kLog };

/// What clients are told about a link that does not change while the server runs.
struct LinkDescription {
  std::string name;  ///< unique within the arm
  LinkModel model;
  Rigid3 base_from_link = {};  ///< mm; where the Arm is given poses they count instead
  std::string frame = {};      ///< link of the URDF that it is fixed to; empty: the base
  SourceKind source = SourceKind::kSimulated;
  LinkRules rules = {};         ///< of its force levels, at the start
  std::string model_hash = {};  ///< Fingerprint of the model's file
  std::string acceptance = {};  ///< of a log: its acceptance (AcceptanceStore::FinishedFile); empty: none
};

/// What a link is made of.
struct LinkParts {
  LinkDescription description;
  std::unique_ptr<FrameSource> source;
  std::unique_ptr<LinkProcessor> processor;
  std::shared_ptr<PressureSource> pressure =
      nullptr;  ///< null: not known where the source does not measure it
  std::shared_ptr<AttitudeSource> attitude = nullptr;    ///< null: as the source has it
  std::shared_ptr<SimulationDesk> simulation = nullptr;  ///< null: not simulated
  LinkFactories factories = {};  ///< of the next source and processor; none: a link that dies stays so
  RealtimeOptions realtime = {};
};

struct ArmOptions {
  LinkWorkerOptions worker = {};
  WatchdogOptions watchdog = {};
  EventOptions events = {};
  std::string acceptance_folder = {};  ///< empty: links cannot be accepted
};

/// All links of an arm, running, and the hub that hands out what they feel.
class Arm {
 public:
  /// `poses`: of all links; null: fixed, as the links' descriptions have them.
  Arm(std::string name, std::vector<LinkParts> links, FrameEncoder encoder, Clock& clock,
      const ArmOptions& options = {}, std::unique_ptr<ArmPoses> poses = nullptr);

  void Start();
  /// Ends in any case: threads that hang are given up.
  void Stop();

  const std::string& name() const { return name_; }
  const std::vector<LinkDescription>& links() const { return links_; }
  std::vector<std::string> link_names() const;
  /// The links' frames come from a log: nothing can be done to them.
  bool plays_log() const { return !links_.empty() && links_[0].source == SourceKind::kLog; }
  LinkSupervisor& worker(size_t link) { return *workers_[link]; }
  const LinkSupervisor& worker(size_t link) const { return *workers_[link]; }
  Watchdog& watchdog() { return watchdog_; }
  PressureSource& pressure(size_t link) { return *pressures_[link]; }
  /// Errors: kFailedPrecondition (no regulator sets the link's pressure).
  Result<PressureController*> regulator(size_t link) const { return pressures_[link]->Controller(); }
  /// Errors: kFailedPrecondition (the link is not simulated).
  Result<std::shared_ptr<SimulationDesk>> simulation(size_t link) const;
  AttitudeSource& attitude(size_t link) { return *attitudes_[link]; }
  /// The index of a link. Errors: kNotFound, with the links there are.
  Result<size_t> FindLink(const std::string& name) const;
  Hub& hub() { return hub_; }
  const Hub& hub() const { return hub_; }
  ArmPoses& poses() { return *poses_; }
  const ArmPoses& poses() const { return *poses_; }
  ArmContacts& contacts() { return *contacts_; }
  EventEngine& events() { return *events_; }
  const EventEngine& events() const { return *events_; }
  AcceptanceStore& acceptances() { return *acceptances_; }
  const AcceptanceStore& acceptances() const { return *acceptances_; }
  Clock& clock() const { return clock_; }

 private:
  // Constant after construction.
  const std::string name_;
  Clock& clock_;
  std::vector<LinkDescription> links_;
  std::unique_ptr<ArmPoses> poses_;
  std::unique_ptr<ArmContacts> contacts_;
  Hub hub_;
  std::unique_ptr<EventEngine> events_;
  std::vector<std::shared_ptr<PressureSource>> pressures_;    // by link
  std::vector<std::shared_ptr<AttitudeSource>> attitudes_;    // by link
  std::vector<std::shared_ptr<SimulationDesk>> simulations_;  // by link; null: not simulated
  std::vector<std::unique_ptr<LinkSupervisor>> workers_;      // by link
  std::unique_ptr<AcceptanceStore> acceptances_;
  Watchdog watchdog_;
};

}  // namespace taclink::server
