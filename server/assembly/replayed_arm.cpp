#include "server/assembly/replayed_arm.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "sensing/model/model_file.h"
#include "server/arm/link_names.h"
#include "server/assembly/arm_builder.h"
#include "server/assembly/log_preamble.h"
#include "server/hub/encoder.h"
#include "server/replay/replay_link.h"
#include "wire/log/topics.h"

namespace taclink::server {
namespace {

// Errors: kNotFound, or the reader's.
Result<std::string> AttachmentOf(const ReplayedLog& log, const std::string& name) {
  for (const mcap::AttachmentIndex& index : log.reader->attachments()) {
    if (index.name != name) continue;
    mcap::Buffer buffer;
    const auto attachment = log.reader->ReadAttachment(index, buffer);
    if (!attachment) return Error{attachment.error().code, log.path + ": " + attachment.error().message};
    return std::string(mcap::AsText(attachment->data));
  }
  return Error{ErrorCode::kNotFound, log.path + ": holds no attachment " + name +
                                         "; only logs that taclinkd recorded can be served"};
}

Result<LinkParts> BuildLink(const LinkConfig& link, const ReplayLink& replay, const ReplayedLog& log,
                            Clock& clock) {
  const std::string name = wire::log::ModelAttachment(link.name);
  const auto text = AttachmentOf(log, name);
  if (!text) return text.error();
  auto model = ParseLinkModel(log.path + ": " + name, *text);
  if (!model) return model.error();
  if (const auto good = CheckRules(link.rules, model->markers); !good) return good.error();
  const auto acceptance = AttachmentOf(log, wire::log::AcceptanceAttachment(link.name));
  return LinkParts{
      .description = {.name = link.name,
                      .model = std::move(*model),
                      .base_from_link = link.FrameFromLink(),
                      .frame = link.frame,
                      .source = SourceKind::kLog,
                      .rules = link.rules,
                      .acceptance = acceptance ? *acceptance : ""},
      .source = MakeReplaySource(replay, clock),
      .processor = MakeReplayProcessor(),
      .factories = {.source = [replay, &clock] { return Result(MakeReplaySource(replay, clock)); },
                    .processor = [] { return Result(MakeReplayProcessor()); }},
      .realtime = link.realtime};
}

// Null: the links' own poses are relative to the base.
Result<std::unique_ptr<ArmPoses>> BuildPoses(const ReplayedLog& log, const Config& config) {
  if (!config.kinematics.urdf) return std::unique_ptr<ArmPoses>();
  const auto xml = AttachmentOf(log, wire::log::kUrdfAttachment);
  if (!xml) {
    SPDLOG_WARN("{}; links are shown where their poses say, as if all frames were the base",
                xml.error().message);
    return std::unique_ptr<ArmPoses>();
  }
  auto kinematics =
      ArmKinematics::Parse(log.path + ": " + wire::log::kUrdfAttachment, *xml, config.kinematics.base);
  if (!kinematics) return kinematics.error();
  return MakePoses(config, std::move(*kinematics));
}

Result<std::unique_ptr<JointReplay>> BuildJoints(const ReplayedLog& log,
                                                 const std::shared_ptr<ReplaySchedule>& schedule, Arm& arm,
                                                 Clock& clock) {
  if (arm.poses().joints().joints().empty()) return std::unique_ptr<JointReplay>();
  auto track = ReplayTrack::Open(
      log.reader,
      {.frames = false, .events = false, .contacts = false, .arm = false, .losses = false, .joints = true},
      schedule);
  if (!track) return track.error();
  return std::make_unique<JointReplay>(std::move(*track), arm.poses(), clock);
}

// Models and calibrations are those of the log, not what files of their names on this machine hold now.
LogPreamble PreambleOf(const ReplayedLog& log, Config config, const std::string& version) {
  config.links.clear();
  config.kinematics.urdf.reset();
  LogPreamble out = MakePreamble(config, version);
  out.files.clear();
  for (const mcap::AttachmentIndex& index : log.reader->attachments()) {
    auto text = AttachmentOf(log, index.name);
    if (text) out.files.push_back({index.name, index.media_type, std::move(*text)});
  }
  for (const mcap::MetadataIndex& index : log.reader->metadata()) {
    if (!index.name.starts_with(wire::log::LinkMetadataName(""))) continue;
    if (auto record = log.reader->ReadMetadata(index)) out.metadata[index.name] = std::move(record->metadata);
  }
  out.metadata[wire::log::kMetadataName]["replay_of"] = log.path;
  return out;
}

}  // namespace

Result<ReplayedLog> OpenReplayedLog(const std::string& path) {
  auto source = mcap::FileSource::Open(path);
  if (!source) return source.error();
  auto reader = mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(*source)));
  if (!reader) return Error{reader.error().code, path + ": " + reader.error().message};
  return ReplayedLog{.path = path, .reader = std::move(*reader)};
}

Result<Config> ConfigureReplay(const ReplayedLog& log, Config server) {
  const auto text = AttachmentOf(log, wire::log::kConfigAttachment);
  if (!text) return text.error();
  auto recorded = ParseConfig(log.path + ": " + wire::log::kConfigAttachment, *text, "");
  if (!recorded) return recorded.error();
  const std::vector<std::string> links = LinksOf(*log.reader);
  server.arm_name = recorded->arm_name;
  server.kinematics = recorded->kinematics;
  server.links.clear();
  for (LinkConfig& link : recorded->links) {
    if (!FindLink(links, link.name)) continue;  // not recorded
    link.realtime = server.realtime;            // another machine's
    server.links.push_back(std::move(link));
  }
  server.recording.at_start = false;
  if (server.links.empty())
    return Error{ErrorCode::kInvalidArgument, log.path + ": holds no frames of the links that it describes"};
  return server;
}

Result<ReplayedArm> BuildReplayedArm(const ReplayedLog& log, const Config& config, const std::string& version,
                                     Clock& clock) {
  const auto& statistics = log.reader->statistics();
  const auto schedule = std::make_shared<ReplaySchedule>(static_cast<int64_t>(statistics.message_start_ns),
                                                         static_cast<int64_t>(statistics.message_end_ns),
                                                         clock, LogGaps(*log.reader));
  auto poses = BuildPoses(log, config);
  if (!poses) return poses.error();
  std::vector<LinkParts> links;
  std::vector<std::string> names;
  for (const LinkConfig& link : config.links) {
    auto parts = BuildLink(
        link, {.log = log.reader, .log_name = log.path, .link = link.name, .schedule = schedule}, log, clock);
    if (!parts) return Error{parts.error().code, "link '" + link.name + "': " + parts.error().message};
    names.push_back(link.name);
    links.push_back(std::move(*parts));
  }
  ReplayedArm out;
  out.arm = std::make_unique<Arm>(config.arm_name, std::move(links), MakeEncoder(names), clock,
                                  ArmOptions{.watchdog = config.watchdog, .events = config.events},
                                  std::move(*poses));
  auto joints = BuildJoints(log, schedule, *out.arm, clock);
  if (!joints) return joints.error();
  out.joints = std::move(*joints);
  out.preamble = PreambleOf(log, config, version);
  return out;
}

}  // namespace taclink::server
