#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>

#include "client/command/cli/json.h"
#include "client/command/cli/log_text.h"
#include "client/command/cli/progress.h"
#include "client/command/cli/protobuf_json.h"
#include "client/command/logs/log_export.h"
#include "client/command/logs/log_output.h"

namespace taclink::command {
namespace {

/// What all lines of a channel need.
struct ChannelText {
  std::string start;  // of each line, up to the times
  ProtobufJson* type = nullptr;
};

class Printer {
 public:
  explicit Printer(LogSource& source) : source_(source) {}

  /// Channels that can be printed. Others are noted.
  std::set<uint16_t> AddChannels(const std::set<uint16_t>& ids) {
    std::set<uint16_t> known;
    for (const uint16_t id : ids) {
      const mcap::Channel& channel = source_.reader().channels().at(id);
      ProtobufJson* type = TypeOf(channel);
      if (type == nullptr) continue;
      const auto quoted = [](const std::string& text) {
        return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
      };
      channels_[id] = {.start = fmt::format("{{\"topic\":{},\"schema\":{}", quoted(channel.topic),
                                            quoted(SchemaOf(source_.reader(), channel))),
                       .type = type};
      known.insert(id);
    }
    return known;
  }

  Result<std::string> Line(const mcap::Message& message, bool with_pictures) {
    const ChannelText& channel = channels_.at(message.channel_id);
    const auto text = channel.type->ToJson(message.data, with_pictures);
    if (!text) return text.error();
    const std::string left_out =
        text->left_out_bytes > 0 ? fmt::format(",\"left_out_bytes\":{}", text->left_out_bytes) : "";
    return fmt::format("{},\"log_time_ns\":{},\"publish_time_ns\":{},\"sequence\":{}{},\"message\":{}}}\n",
                       channel.start, message.log_time_ns, message.publish_time_ns, message.sequence,
                       left_out, text->json);
  }

 private:
  /// Null: its messages can't be printed.
  ProtobufJson* TypeOf(const mcap::Channel& channel) {
    const auto schema = source_.reader().schemas().find(channel.schema_id);
    if (channel.message_encoding != "protobuf" || schema == source_.reader().schemas().end()) {
      source_.NoteLeftOut(fmt::format("topic {}: it is not protobuf with a schema but '{}'", channel.topic,
                                      channel.message_encoding));
      return nullptr;
    }
    const auto [known, added] = types_.try_emplace(channel.schema_id, nullptr);
    if (!added) return known->second.get();
    auto type = ProtobufJson::Create(schema->second);
    if (!type) {
      source_.NoteLeftOut(fmt::format("topic {}: {}", channel.topic, type.error().message));
      return nullptr;
    }
    known->second = std::move(*type);
    return known->second.get();
  }

  LogSource& source_;
  std::map<uint16_t, std::unique_ptr<ProtobufJson>> types_;  // by schema; null: it can't be used
  std::map<uint16_t, ChannelText> channels_;
};

}  // namespace

Result<void> ExportJsonl(LogSource& source, const LogPart& part, const std::string& folder,
                         bool with_pictures) {
  auto out = OutputText::Create(folder + "/messages.jsonl");
  if (!out) return out.error();
  Printer printer(source);
  const std::set<uint16_t> channels = printer.AddChannels(ChannelsOf(source.reader(), part));
  Progress progress(source.file());
  LogMessages messages(source, {.start_ns = part.start_ns, .end_ns = part.end_ns, .channels = channels});
  uint64_t lines = 0;
  while (const auto message = messages.Next()) {
    progress.Show(messages.share());
    const auto line = printer.Line(*message, with_pictures);
    if (!line) {
      source.NoteLeftOut(fmt::format("a message of {} at {}: {}",
                                     source.reader().channels().at(message->channel_id).topic,
                                     UtcText(message->log_time_ns), line.error().message));
      continue;
    }
    if (const auto written = (*out)->Write(*line); !written) return written;
    ++lines;
  }
  if (const auto finished = (*out)->Finish(); !finished) return finished;
  fmt::print("{}: {} messages\n", (*out)->path(), lines);
  return {};
}

}  // namespace taclink::command
