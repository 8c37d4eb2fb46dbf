#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "client/command/cli/progress.h"
#include "client/command/logs/log_output.h"
#include "client/command/logs/log_source.h"
#include "client/command/logs/log_tools.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

struct LogMergeOptions {
  std::vector<std::string> inputs;
  std::string output, compression;
};

using Sources = std::vector<std::unique_ptr<LogSource>>;
using Ids = std::map<uint16_t, uint16_t>;  // in the new log, by the id in a source

/// Gives what is the same in several logs one place in the new one.
class Merger {
 public:
  explicit Merger(mcap::Writer& out) : out_(out) {}

  Result<Ids> AddChannels(const mcap::Reader& reader) {
    Ids ids;
    for (const auto& [id, source] : reader.channels()) {
      mcap::Channel channel = source;
      const auto schema = SchemaIdOf(reader, channel);
      if (!schema) return schema.error();
      channel.schema_id = *schema;
      auto key = std::tuple(channel.topic, channel.schema_id, channel.message_encoding, channel.metadata);
      auto known = channels_.find(key);
      if (known == channels_.end()) {
        const auto added = out_.AddChannel(std::move(channel));
        if (!added) return added.error();
        known = channels_.emplace(std::move(key), *added).first;
      }
      ids[id] = known->second;
    }
    return ids;
  }

  Result<void> AddAttachments(LogSource& source) {
    mcap::Buffer buffer;
    for (const auto& index : source.reader().attachments()) {
      if (index.name == wire::log::kSummaryName) continue;  // of the one log
      const auto attachment = source.reader().ReadAttachment(index, buffer);
      if (!attachment) {
        source.NoteDamage("attachment " + index.name + ": " + attachment.error().message);
        continue;
      }
      if (IsThere(*attachment)) continue;
      if (const auto added = out_.AddAttachment(*attachment); !added) return added;
      attachments_.emplace(index.name, std::pair(&source.reader(), index));
    }
    return {};
  }

  Result<void> AddMetadata(LogSource& source) {
    for (const auto& index : source.reader().metadata()) {
      const auto metadata = source.reader().ReadMetadata(index);
      if (!metadata) {
        source.NoteDamage("metadata " + index.name + ": " + metadata.error().message);
      } else if (metadata_.emplace(metadata->name, metadata->metadata).second) {
        if (const auto added = out_.AddMetadata(*metadata); !added) return added;
      }
    }
    return {};
  }

 private:
  Result<uint16_t> SchemaIdOf(const mcap::Reader& reader, const mcap::Channel& channel) {
    const auto source = reader.schemas().find(channel.schema_id);
    if (source == reader.schemas().end()) return uint16_t{0};  // none, or lost with what is damaged
    mcap::Schema schema = source->second;
    auto key = std::tuple(schema.name, schema.encoding, schema.data);
    const auto known = schemas_.find(key);
    if (known != schemas_.end()) return known->second;
    const auto added = out_.AddSchema(std::move(schema));
    if (added) schemas_.emplace(std::move(key), *added);
    return added;
  }

  // The bytes are compared where they lie: attachments may be too many to hold.
  bool IsThere(const mcap::Attachment& attachment) const {
    mcap::Buffer buffer;
    const auto [begin, end] = attachments_.equal_range(attachment.name);
    for (auto at = begin; at != end; ++at) {
      const auto& [reader, index] = at->second;
      if (index.media_type != attachment.media_type || index.data_size != attachment.data.size()) continue;
      const auto other = reader->ReadAttachment(index, buffer);
      if (other && std::ranges::equal(other->data, attachment.data)) return true;
    }
    return false;
  }

  mcap::Writer& out_;
  std::map<std::tuple<std::string, std::string, std::string>, uint16_t> schemas_;
  std::map<std::tuple<std::string, uint16_t, std::string, mcap::TextMap>, uint16_t> channels_;
  std::multimap<std::string, std::pair<const mcap::Reader*, mcap::AttachmentIndex>> attachments_;
  std::set<std::pair<std::string, mcap::TextMap>> metadata_;
};

/// One of the logs, while its messages are taken.
struct Input {
  Ids channels;
  LogMessages messages;
  std::optional<mcap::Message> next = {};
};

/// By log time; messages of the same time in the order of the inputs. A log is not read before its time has
/// come.
Result<void> MergeMessages(std::vector<Input>& inputs, const Sources& sources, mcap::Writer& out) {
  using Turn = std::pair<uint64_t, size_t>;  // log time, input
  std::priority_queue<Turn, std::vector<Turn>, std::greater<>> turns;
  for (size_t i = 0; i < inputs.size(); ++i)
    turns.emplace(sources[i]->reader().statistics().message_start_ns, i);
  Progress progress("the logs");
  while (!turns.empty()) {
    const size_t i = turns.top().second;
    turns.pop();
    Input& input = inputs[i];
    if (input.next) {
      mcap::Message message = *input.next;
      message.channel_id = input.channels.at(message.channel_id);
      if (const auto written = out.Write(message); !written) return written;
    }
    input.next = input.messages.Next();
    double shares = 0;
    for (const Input& each : inputs) shares += each.messages.share();
    progress.Show(shares / static_cast<double>(inputs.size()));
    if (input.next) turns.emplace(input.next->log_time_ns, i);
  }
  return {};
}

// One log of which nothing is left does not stop the others.
Result<void> Report(const Sources& sources) {
  size_t failed = 0;
  for (const auto& source : sources) {
    const auto reported = source->Report();
    if (reported) continue;
    if (++failed == sources.size()) return reported;
    fmt::print(stderr, "taclink: {}\n", reported.error().message);
  }
  return {};
}

Result<void> Merge(const LogMergeOptions& options) {
  Sources sources;
  for (const std::string& file : options.inputs) {
    auto source = LogSource::Open(file);
    if (!source) return source.error();
    sources.push_back(std::move(*source));
  }
  const auto compression = CompressionFor(sources.front()->reader(), options.compression);
  if (!compression) return compression.error();
  auto output = OutputLog::Create(
      options.output, {.profile = sources.front()->reader().header().profile, .compression = *compression});
  if (!output) return output.error();
  Merger merger((*output)->writer());
  std::vector<Input> inputs;
  inputs.reserve(sources.size());
  for (const auto& source : sources) {
    auto channels = merger.AddChannels(source->reader());
    if (!channels) return channels.error();
    if (const auto added = merger.AddAttachments(*source); !added) return added;
    if (const auto added = merger.AddMetadata(*source); !added) return added;
    inputs.push_back({.channels = std::move(*channels), .messages = LogMessages(*source, {})});
  }
  if (const auto merged = MergeMessages(inputs, sources, (*output)->writer()); !merged) return merged;
  if (const auto reported = Report(sources); !reported) return reported;
  return (*output)->Finish();
}

}  // namespace

void AddLogMerge(const Arguments& log, Selected& selected) {
  auto options = std::make_shared<LogMergeOptions>();
  const Arguments merge = log.AddCommand("merge", "Write several logs to one, in order of log time");
  merge.AddOption("files", options->inputs, "The logs, MCAP").Required();
  merge.AddOption("-o,--output", options->output, "The new log").Required();
  AddCompressionOption(merge, options->compression);
  merge.OnChosen([options, &selected] { selected = [options] { return Merge(*options); }; });
}

}  // namespace taclink::command
