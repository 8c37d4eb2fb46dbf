#include "wire/log/topics.h"

#include <array>

namespace taclink::wire::log {
namespace {

constexpr std::string_view kLinks = "/links/";

struct Named {
  TopicKind kind;
  std::string_view text;
};
constexpr std::array<Named, 6> kArmTopics = {{{TopicKind::kArm, "/arm"},
                                              {TopicKind::kContacts, "/contacts"},
                                              {TopicKind::kEvents, "/events"},
                                              {TopicKind::kJoints, "/joint_states"},
                                              {TopicKind::kLosses, "/losses"},
                                              {TopicKind::kTransforms, "/transforms"}}};

// What follows the link's name.
std::string Suffix(const Topic& topic) {
  switch (topic.kind) {
    case TopicKind::kFrame:
      return "/frame";
    case TopicKind::kScene:
      return "/scene";
    default:
      return std::string("/camera/") + Name(topic.camera);
  }
}

}  // namespace

std::string ToText(const Topic& topic) {
  for (const Named& named : kArmTopics) {
    if (named.kind == topic.kind) return std::string(named.text);
  }
  return std::string(kLinks) + topic.link + Suffix(topic);
}

std::optional<Topic> ParseTopic(std::string_view text) {
  for (const Named& named : kArmTopics) {
    if (named.text == text) return Topic{.kind = named.kind};
  }
  if (!text.starts_with(kLinks)) return std::nullopt;
  const std::string_view rest = text.substr(kLinks.size());
  const Topic forms[] = {{.kind = TopicKind::kFrame},
                         {.kind = TopicKind::kScene},
                         {.kind = TopicKind::kPicture, .camera = CameraId::kTop},
                         {.kind = TopicKind::kPicture, .camera = CameraId::kBottom}};
  for (Topic form : forms) {
    const std::string suffix = Suffix(form);
    if (!rest.ends_with(suffix) || rest.size() == suffix.size()) continue;
    form.link = rest.substr(0, rest.size() - suffix.size());
    return form;
  }
  return std::nullopt;
}

std::string LinkFrameId(std::string_view link) {
  return "link/" + std::string(link);
}

std::string CameraFrameId(std::string_view link, CameraId camera) {
  return LinkFrameId(link) + "/" + Name(camera);
}

std::string LinkMetadataName(std::string_view link) {
  return std::string(kMetadataName) + ".link." + std::string(link);
}

std::string ModelAttachment(std::string_view link) {
  return "links/" + std::string(link) + "/model.yaml";
}

std::string CalibrationAttachment(std::string_view link) {
  return "links/" + std::string(link) + "/calibration.yaml";
}

std::string AcceptanceAttachment(std::string_view link) {
  return "links/" + std::string(link) + "/acceptance.json";
}

}  // namespace taclink::wire::log
