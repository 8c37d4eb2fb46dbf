#include "server/replay/log_pictures.h"

#include <algorithm>
#include <map>
#include <set>

#include "mcap/cursor.h"
#include "server/arm/link_names.h"
#include "server/replay/log_channels.h"
#include "server/replay/log_player.h"
#include "wire/log/picture.h"
#include "wire/log/topics.h"

namespace taclink::server {
namespace {

using wire::log::TopicKind;

// From the exposure to when a frame is published, which is its log time; of nearly all.
constexpr uint64_t kLongestSolvingNs = 200'000'000;

std::map<uint16_t, CameraId> PictureChannels(const mcap::Reader& reader, const std::string& link) {
  std::map<uint16_t, CameraId> out;
  for (const auto& [id, channel] : reader.channels()) {
    const auto topic = wire::log::ParseTopic(channel.topic);
    if (topic && topic->kind == TopicKind::kPicture && topic->link == link) out.emplace(id, topic->camera);
  }
  return out;
}

Result<RawImage> Decode(const mcap::Reader& reader, const mcap::Message& message) {
  const auto schema = reader.schemas().find(reader.channels().at(message.channel_id).schema_id);
  if (schema == reader.schemas().end())
    return Error{ErrorCode::kInvalidArgument, "a channel of pictures has no schema"};
  return wire::log::DecodePicture(schema->second.name,
                                  {reinterpret_cast<const char*>(message.data.data()), message.data.size()});
}

}  // namespace

Result<LogPictures> FindPictures(const mcap::Reader& reader, const std::string& link, int64_t utc_ns) {
  if (const auto known = FindLink(LinksOf(reader), link); !known) return known.error();
  const auto cameras = PictureChannels(reader, link);
  if (cameras.empty())
    return Error{ErrorCode::kFailedPrecondition, "no pictures of link '" + link + "' were recorded"};
  std::set<uint16_t> missing;
  for (const auto& [id, camera] : cameras) missing.insert(id);
  const auto at_ns = static_cast<uint64_t>(std::max<int64_t>(0, utc_ns));
  const uint64_t start_ns = at_ns - std::min<uint64_t>(at_ns, LogPlayer::kLookBackNs);
  mcap::MessageCursor cursor(reader, {.start_ns = start_ns,
                                      .end_ns = at_ns + kLongestSolvingNs,
                                      .channels = missing,
                                      .order = mcap::MessageOrder::kReverseLogTime});
  LogPictures out;
  bool found = false;
  while (!missing.empty()) {
    const auto message = cursor.Next();
    if (!message && message.error().code == ErrorCode::kEndOfData) break;
    if (!message) return message.error();
    if (message->publish_time_ns > at_ns) continue;
    if (found && message->sequence != out.sequence) break;  // an older frame's
    if (missing.erase(message->channel_id) == 0) continue;
    found = true;
    out.sequence = message->sequence;
    out.exposure_utc_ns = static_cast<int64_t>(message->publish_time_ns);
    auto image = Decode(reader, *message);
    if (!image) return image.error();
    out.images[Index(cameras.at(message->channel_id))] = std::move(*image);
  }
  if (!found)
    return Error{ErrorCode::kFailedPrecondition,
                 "no pictures of link '" + link + "' were recorded in the 2 s before this time"};
  return out;
}

}  // namespace taclink::server
