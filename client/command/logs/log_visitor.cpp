#include "client/command/logs/log_visitor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>

#include "client/command/cli/log_text.h"
#include "client/command/cli/progress.h"

namespace taclink::command {
namespace {

/// Parses messages of one type, and hands over those of the part's links.
template <typename T>
class Intake {
 public:
  Intake(LogSource& source, const LogPart& part, const LogVisitor::Take<T>& take)
      : source_(source), part_(part), take_(take) {}

  Result<void> Take(const mcap::Message& message) {
    if (!message_.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
      source_.NoteLeftOut(fmt::format("a message of {} at {}: it does not parse as {}",
                                      source_.reader().channels().at(message.channel_id).topic,
                                      UtcText(message.log_time_ns), T::descriptor()->full_name()));
      return {};
    }
    if constexpr (!std::is_same_v<T, v1::JointSample>) {
      if (!message_.link().empty() && !part_.Has(message_.link())) return {};
    }
    return take_(message_, static_cast<int64_t>(message.log_time_ns));
  }

 private:
  LogSource& source_;
  const LogPart& part_;
  const LogVisitor::Take<T>& take_;
  T message_;  // its memory is used again
};

}  // namespace

Result<void> Visit(LogSource& source, const LogPart& part, const LogVisitor& visitor) {
  Intake<v1::LinkFrame> frames(source, part, visitor.frame);
  Intake<v1::Event> events(source, part, visitor.event);
  Intake<v1::JointSample> joints(source, part, visitor.joints);
  std::map<uint16_t, std::function<Result<void>(const mcap::Message&)>> takers;
  const mcap::Reader& reader = source.reader();
  for (const uint16_t id : ChannelsOf(reader, part)) {
    const mcap::Channel& channel = reader.channels().at(id);
    const std::string schema = SchemaOf(reader, channel);
    if (channel.message_encoding != "protobuf") continue;
    if (visitor.frame && schema == v1::LinkFrame::descriptor()->full_name())
      takers[id] = [&](const mcap::Message& message) { return frames.Take(message); };
    if (visitor.event && schema == v1::Event::descriptor()->full_name())
      takers[id] = [&](const mcap::Message& message) { return events.Take(message); };
    if (visitor.joints && schema == v1::JointSample::descriptor()->full_name())
      takers[id] = [&](const mcap::Message& message) { return joints.Take(message); };
  }
  std::set<uint16_t> channels;
  for (const auto& [id, take] : takers) channels.insert(id);
  Progress progress(source.file());
  LogMessages messages(source, {.start_ns = part.start_ns, .end_ns = part.end_ns, .channels = channels});
  while (const auto message = messages.Next()) {
    progress.Show(messages.share());
    if (const auto taken = takers.at(message->channel_id)(*message); !taken) return taken;
  }
  return {};
}

bool IsMeasured(const v1::LinkFrame& frame) {
  // Older logs have zeros where the forces can't be trusted.
  return frame.has_total_force_n() && !frame.force_not_converged() &&
         (frame.markers_seen() > 0 || frame.positions_m_size() > 0);
}

std::string EnumText(const std::string& name, const std::string& prefix, int number) {
  if (name.empty()) return std::to_string(number);
  std::string text = name.starts_with(prefix) ? name.substr(prefix.size()) : name;
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace taclink::command
