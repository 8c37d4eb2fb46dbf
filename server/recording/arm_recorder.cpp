#include "server/recording/arm_recorder.h"

#include <algorithm>
#include <map>

#include "server/messages/arm_message.h"
#include "server/messages/contacts_message.h"
#include "server/messages/event_message.h"
#include "taclink/v1/log.pb.h"
#include "wire/log/scene.h"

namespace taclink::server {
namespace {

using wire::log::Topic;
using wire::log::TopicKind;

constexpr double kContactRateHz = 30;  // of all links together
constexpr int64_t kArmPeriodNs = 1'000'000'000;

}  // namespace

ArmRecorder::ArmRecorder(Arm& arm, const LogClock& log_clock, double scene_rate_hz, Write write)
    : arm_(arm),
      log_clock_(log_clock),
      write_(std::move(write)),
      link_names_(arm.link_names()),
      joints_(arm.poses().joints().joints()),
      joint_times_(joints_.size(), arm.clock().MonotonicNs()),
      contact_rate_(kContactRateHz),
      newest_(arm.links().size()) {
  if (scene_rate_hz > 0) scene_rates_.assign(arm.links().size(), RateLimit(scene_rate_hz));
  EventHistory& history = arm.events().history();
  event_cursor_ = std::make_unique<EventCursor>(history, history.newest(), EventFilter{}, [] {});
}

void ArmRecorder::BeginLog() {
  arm_ns_ = 0;
  contacts_begun_ = 0;
}

void ArmRecorder::TakeFrame(const Publication& publication, int64_t utc_ns) {
  const auto contacts = arm_.contacts().Of(publication);
  newest_[publication.link()] = contacts;
  const int64_t published_ns = publication.state().times.published_ns;
  if (contact_rate_.Due(published_ns)) {
    Fill(newest_, link_names_, arm_.poses(), contacts_message_);
    contacts_message_.set_sequence(++contacts_sequence_);
    contacts_message_.set_utc_ns(utc_ns);
    write_({.kind = TopicKind::kContacts}, contacts_message_, {.log_utc_ns = utc_ns});
  }
  if (!scene_rates_.empty() && scene_rates_[publication.link()].Due(published_ns))
    TakeScene(publication, *contacts, utc_ns);
}

void ArmRecorder::TakeScene(const Publication& publication, const LinkContacts& contacts, int64_t utc_ns) {
  const LinkDescription& link = arm_.links()[publication.link()];
  foxglove::FrameTransform transform;
  wire::log::Fill(link.name, contacts.pose.base_from_link, utc_ns, transform);
  write_({.kind = TopicKind::kTransforms}, transform, {.log_utc_ns = utc_ns});
  foxglove::SceneUpdate scene;
  wire::log::Fill(link.name, link.model.markers, publication.state(), utc_ns, scene);
  write_({.kind = TopicKind::kScene, .link = link.name}, scene, {.log_utc_ns = utc_ns});
}

void ArmRecorder::TakeRest() {
  TakeEvents();
  TakeJoints();
  TakeArm();
}

void ArmRecorder::TakeEvents() {
  while (true) {
    const EventCursor::Step step = event_cursor_->Next();
    if (step.status) continue;
    if (!step.event) return;
    const Event& event = *step.event;
    v1::Event message;
    Fill(event, event.link ? link_names_[*event.link] : std::string(), message);
    write_({.kind = TopicKind::kEvents}, message,
           {.log_utc_ns = log_clock_.Utc(event.raised_ns), .sequence = event.sequence});
    ++events_;
    if (event.kind == EventKind::kContactBegin) ++contacts_begun_;
  }
}

// One message for all joints that have a state of the same instant.
void ArmRecorder::TakeJoints() {
  if (joints_.empty()) return;
  std::map<int64_t, v1::JointSample> samples;
  for (size_t joint = 0; joint < joints_.size(); ++joint) {
    for (const JointSample& state : arm_.poses().joints().After(joint, joint_times_[joint])) {
      v1::JointSample& sample = samples[state.time_ns];
      sample.add_names(joints_[joint].name);
      sample.add_positions(state.position);
      if (state.velocity) sample.add_velocities(*state.velocity);
      joint_times_[joint] = state.time_ns;
    }
  }
  for (auto& [time_ns, sample] : samples) {
    if (sample.velocities_size() != sample.positions_size()) sample.clear_velocities();
    sample.set_monotonic_ns(time_ns);
    sample.set_utc_ns(log_clock_.Utc(time_ns));
    write_({.kind = TopicKind::kJoints}, sample, {.log_utc_ns = sample.utc_ns()});
  }
}

void ArmRecorder::TakeArm() {
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (arm_ns_ != 0 && now_ns - arm_ns_ < kArmPeriodNs) return;
  arm_ns_ = now_ns;
  v1::Arm message;
  Fill(arm_, message);
  write_({.kind = TopicKind::kArm}, message, {.log_utc_ns = log_clock_.NowUtc()});
}

}  // namespace taclink::server
