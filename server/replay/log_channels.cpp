#include "server/replay/log_channels.h"

#include <optional>
#include <string_view>

#include "server/arm/link_names.h"

namespace taclink::server {
namespace {

using wire::log::Topic;
using wire::log::TopicKind;

// Empty: never played.
std::string_view TypeOf(TopicKind kind) {
  switch (kind) {
    case TopicKind::kFrame:
      return "taclink.v1.LinkFrame";
    case TopicKind::kArm:
      return "taclink.v1.Arm";
    case TopicKind::kContacts:
      return "taclink.v1.StreamContactsResponse";
    case TopicKind::kEvents:
      return "taclink.v1.Event";
    case TopicKind::kJoints:
      return "taclink.v1.JointSample";
    case TopicKind::kLosses:
      return "taclink.v1.RecordingLoss";
    default:
      return "";
  }
}

std::optional<Topic> TopicOf(const mcap::Reader& reader, const mcap::Channel& channel) {
  auto topic = wire::log::ParseTopic(channel.topic);
  const auto schema = reader.schemas().find(channel.schema_id);
  if (!topic || schema == reader.schemas().end() || channel.message_encoding != "protobuf")
    return std::nullopt;
  const std::string_view type = TypeOf(topic->kind);
  if (type.empty() || schema->second.name != type) return std::nullopt;
  return topic;
}

bool Wanted(const Topic& topic, const std::vector<std::string>& links, const std::vector<bool>& chosen,
            const LogSelection& selection) {
  switch (topic.kind) {
    case TopicKind::kFrame: {
      const auto link = FindLink(links, topic.link);
      return selection.frames && (chosen.empty() || (link && chosen[*link]));
    }
    case TopicKind::kArm:
      return selection.arm;
    case TopicKind::kContacts:
      return selection.contacts;
    case TopicKind::kEvents:
      return selection.events;
    case TopicKind::kJoints:
      return selection.joints;
    default:
      return selection.losses;
  }
}

}  // namespace

std::vector<std::string> LinksOf(const mcap::Reader& reader) {
  std::vector<std::string> links;
  for (const auto& [id, channel] : reader.channels()) {
    const auto topic = TopicOf(reader, channel);
    if (topic && topic->kind == TopicKind::kFrame && !FindLink(links, topic->link))
      links.push_back(topic->link);
  }
  return links;
}

Result<LogChannels> ChooseChannels(const mcap::Reader& reader, const LogSelection& selection) {
  const std::vector<std::string> links = LinksOf(reader);
  const auto chosen = FindLinks(links, selection.links);
  if (!chosen) return Error{chosen.error().code, "in the log: " + chosen.error().message};
  LogChannels out;
  for (const auto& [id, channel] : reader.channels()) {
    const auto topic = TopicOf(reader, channel);
    if (!topic || !Wanted(*topic, links, *chosen, selection)) continue;
    const bool frame = topic->kind == TopicKind::kFrame;
    const bool state = frame || topic->kind == TopicKind::kArm || topic->kind == TopicKind::kContacts;
    out.topics.emplace(id, *topic);
    out.played.emplace(id, PlayedChannel{.frame = frame, .state = state});
  }
  return out;
}

}  // namespace taclink::server
