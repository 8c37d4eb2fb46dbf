#include <memory>
#include <set>
#include <string>
#include <vector>

#include "client/command/cli/progress.h"
#include "client/command/logs/log_output.h"
#include "client/command/logs/log_source.h"
#include "client/command/logs/log_tools.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

struct LogCutOptions {
  std::string input, output, compression;
  PartOptions part;
  std::vector<std::string> topics;
  bool without_pictures = false;
};

bool IsPicture(const mcap::Reader& reader, const mcap::Channel& channel) {
  const auto topic = wire::log::ParseTopic(channel.topic);
  const std::string schema = SchemaOf(reader, channel);
  return (topic && topic->kind == wire::log::TopicKind::kPicture) || schema == "foxglove.CompressedImage" ||
         schema == "foxglove.RawImage";
}

Result<std::set<uint16_t>> ChooseChannels(const LogSource& source, const LogCutOptions& options,
                                          const LogPart& part) {
  const mcap::Reader& reader = source.reader();
  std::set<std::string> known;
  for (const auto& [id, channel] : reader.channels()) known.insert(channel.topic);
  for (const std::string& topic : options.topics) {
    if (!known.contains(topic)) {
      return Error{ErrorCode::kNotFound,
                   source.file() + ": has no topic '" + topic + "'; there are: " + Joined(known)};
    }
  }
  const std::set<std::string> wanted(options.topics.begin(), options.topics.end());
  std::set<uint16_t> channels = ChannelsOf(reader, part);
  std::erase_if(channels, [&](uint16_t id) {
    const mcap::Channel& channel = reader.channels().at(id);
    if (!wanted.empty() && !wanted.contains(channel.topic)) return true;
    return options.without_pictures && IsPicture(reader, channel);
  });
  return channels;
}

/// With the ids that they have.
Result<void> CopyDefinitions(const mcap::Reader& reader, const std::set<uint16_t>& channels,
                             mcap::Writer& out) {
  for (const uint16_t id : channels) {
    mcap::Channel channel = reader.channels().at(id);
    const auto schema = reader.schemas().find(channel.schema_id);
    if (schema == reader.schemas().end()) {
      channel.schema_id = 0;  // none, or lost with what is damaged
    } else if (const auto added = out.KeepSchema(schema->second); !added) {
      return added.error();
    }
    if (const auto added = out.KeepChannel(std::move(channel)); !added) return added.error();
  }
  return {};
}

Result<void> CopyRecords(LogSource& source, mcap::Writer& out) {
  mcap::Buffer buffer;
  for (const auto& index : source.reader().attachments()) {
    if (index.name == wire::log::kSummaryName) continue;  // of the whole log
    const auto attachment = source.reader().ReadAttachment(index, buffer);
    if (!attachment) {
      source.NoteDamage("attachment " + index.name + ": " + attachment.error().message);
    } else if (const auto added = out.AddAttachment(*attachment); !added) {
      return added;
    }
  }
  for (const auto& index : source.reader().metadata()) {
    const auto metadata = source.reader().ReadMetadata(index);
    if (!metadata) {
      source.NoteDamage("metadata " + index.name + ": " + metadata.error().message);
    } else if (const auto added = out.AddMetadata(*metadata); !added) {
      return added;
    }
  }
  return {};
}

Result<void> Cut(const LogCutOptions& options) {
  auto source = LogSource::Open(options.input);
  if (!source) return source.error();
  const mcap::Reader& reader = (*source)->reader();
  const auto part = ChoosePart(**source, options.part);
  if (!part) return part.error();
  const auto channels = ChooseChannels(**source, options, *part);
  if (!channels) return channels.error();
  const auto compression = CompressionFor(reader, options.compression);
  if (!compression) return compression.error();
  auto output = OutputLog::Create(
      options.output,
      {.profile = reader.header().profile, .library = reader.header().library, .compression = *compression});
  if (!output) return output.error();
  mcap::Writer& writer = (*output)->writer();
  if (const auto copied = CopyDefinitions(reader, *channels, writer); !copied) return copied;
  if (const auto copied = CopyRecords(**source, writer); !copied) return copied;
  LogMessages messages(**source, {.start_ns = part->start_ns,
                                  .end_ns = part->end_ns,
                                  .channels = *channels,
                                  .order = mcap::MessageOrder::kFile});
  Progress progress(options.input);
  while (const auto message = messages.Next()) {
    progress.Show(messages.share());
    if (const auto written = writer.Write(*message); !written) return written;
  }
  if (const auto reported = (*source)->Report(); !reported) return reported;
  return (*output)->Finish();
}

}  // namespace

void AddLogCut(const Arguments& log, Selected& selected) {
  auto options = std::make_shared<LogCutOptions>();
  const Arguments cut = log.AddCommand("cut", "Write a part of a log to a new one, message for message");
  cut.AddOption("file", options->input, "The log, MCAP").Required();
  cut.AddOption("-o,--output", options->output, "The new log").Required();
  AddPartOptions(cut, options->part);
  cut.AddFlag("--without-pictures", options->without_pictures, "Leave the cameras' pictures out");
  cut.AddOption("--only-topics", options->topics,
                "Leave all other topics out; as 'taclink log info' names them");
  AddCompressionOption(cut, options->compression);
  cut.OnChosen([options, &selected] { selected = [options] { return Cut(*options); }; });
}

}  // namespace taclink::command
