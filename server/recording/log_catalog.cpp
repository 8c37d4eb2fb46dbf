#include "server/recording/log_catalog.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "mcap/cursor.h"
#include "server/recording/log_file.h"
#include "wire/log/topics.h"

namespace taclink::server {
namespace {

using wire::log::TopicKind;

uint64_t MessagesOf(const mcap::Reader& reader, uint16_t channel) {
  const auto& counts = reader.statistics().channel_message_counts;
  const auto at = counts.find(channel);
  return at == counts.end() ? 0 : at->second;
}

mcap::TextMap MetadataOf(const mcap::Reader& reader, const char* name) {
  for (const mcap::MetadataIndex& index : reader.metadata()) {
    if (index.name != name) continue;
    if (auto record = reader.ReadMetadata(index)) return std::move(record->metadata);
  }
  return {};
}

// A damaged summary is ignored: the log can be read without it.
void FillSummary(const mcap::Reader& reader, v1::Log& out) {
  for (const mcap::AttachmentIndex& index : reader.attachments()) {
    if (index.name != wire::log::kSummaryName) continue;
    mcap::Buffer buffer;
    const auto attachment = reader.ReadAttachment(index, buffer);
    v1::LogSummary summary;
    if (attachment &&
        summary.ParseFromArray(attachment->data.data(), static_cast<int>(attachment->data.size())))
      *out.mutable_summary() = std::move(summary);
  }
}

void Fill(const mcap::Reader& reader, v1::Log& out) {
  const mcap::Statistics& statistics = reader.statistics();
  out.set_start_utc_ns(static_cast<int64_t>(statistics.message_start_ns));
  out.set_end_utc_ns(static_cast<int64_t>(statistics.message_end_ns));
  out.set_problem(reader.summary_problem());
  for (const auto& [id, channel] : reader.channels()) {
    const auto topic = wire::log::ParseTopic(channel.topic);
    if (!topic) continue;
    if (topic->kind == TopicKind::kPicture) out.set_pictures(true);
    if (topic->kind != TopicKind::kFrame) continue;
    out.add_links(topic->link);
    out.set_frames(out.frames() + MessagesOf(reader, id));
  }
  const mcap::TextMap begin = MetadataOf(reader, wire::log::kMetadataName);
  if (const auto note = begin.find("note"); note != begin.end()) out.set_note(note->second);
  FillSummary(reader, out);
  const mcap::TextMap totals = MetadataOf(reader, wire::log::kTotalsName);
  uint64_t contacts = 0;
  const auto at = totals.find("contacts");
  if (at == totals.end()) return;
  const char* const end = at->second.data() + at->second.size();
  if (std::from_chars(at->second.data(), end, contacts).ptr == end) out.set_contacts(contacts);
}

std::string SchemaOf(const mcap::Reader& reader, const mcap::Channel& channel) {
  const auto at = reader.schemas().find(channel.schema_id);
  return at == reader.schemas().end() ? "" : at->second.name;
}

// The messages of one kind, parsed; what is damaged is left out.
template <typename T, typename F>
void ForEach(const mcap::Reader& reader, TopicKind kind, const F& visit) {
  std::set<uint16_t> wanted;
  for (const auto& [id, channel] : reader.channels()) {
    const auto topic = wire::log::ParseTopic(channel.topic);
    if (topic && topic->kind == kind) wanted.insert(id);
  }
  if (wanted.empty()) return;
  mcap::MessageCursor cursor(reader, {.channels = wanted});
  while (true) {
    const auto message = cursor.Next();
    if (!message && message.error().code == ErrorCode::kEndOfData) return;
    T parsed;
    if (!message || !parsed.ParseFromArray(message->data.data(), static_cast<int>(message->data.size())))
      continue;
    if (!visit(std::move(parsed))) return;
  }
}

}  // namespace

Result<std::unique_ptr<mcap::Reader>> LogCatalog::Open(const std::string& name, LogFileEntry* entry) const {
  const auto found = folder_.Find(name);
  if (!found) return found.error();
  if (entry != nullptr) *entry = *found;
  auto source = mcap::FileSource::Open(folder_.PathOf(*found));
  if (!source) return source.error();
  auto reader = mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(*source)));
  if (!reader) return Error{reader.error().code, name + ": " + reader.error().message};
  return reader;
}

v1::Log LogCatalog::Summarise(const LogFileEntry& entry) const {
  v1::Log log;
  log.set_name(entry.name);
  log.set_bytes(entry.bytes);
  log.set_open(entry.open);
  if (entry.open) return log;  // has no summary yet; reading all of it takes long
  const auto reader = Open(entry.name);
  if (reader) {
    Fill(**reader, log);
  } else {
    log.set_problem(reader.error().message);
  }
  return log;
}

std::vector<v1::Log> LogCatalog::List() {
  std::vector<v1::Log> logs;
  std::map<std::string, Known> known;
  const std::lock_guard lock(mutex_);
  for (const LogFileEntry& entry : folder_.List()) {
    const auto at = known_.find(entry.name);
    const bool same = at != known_.end() && at->second.bytes == entry.bytes && !entry.open;
    v1::Log log = same ? at->second.log : Summarise(entry);
    logs.push_back(log);
    if (!entry.open) known[entry.name] = {entry.bytes, std::move(log)};
  }
  known_ = std::move(known);  // those that are gone are forgotten
  return logs;
}

Result<v1::DescribeLogResponse> LogCatalog::Describe(const std::string& name) {
  LogFileEntry entry;
  const auto reader = Open(name, &entry);
  if (!reader) return reader.error();
  v1::DescribeLogResponse out;
  out.mutable_log()->set_name(entry.name);
  out.mutable_log()->set_bytes(entry.bytes);
  Fill(**reader, *out.mutable_log());
  out.mutable_log()->set_open(entry.open);
  if (entry.open) out.mutable_log()->clear_problem();
  for (const auto& [id, channel] : (*reader)->channels()) {
    v1::LogChannel& told = *out.add_channels();
    told.set_topic(channel.topic);
    told.set_schema(SchemaOf(**reader, channel));
    told.set_messages(MessagesOf(**reader, id));
  }
  for (const mcap::AttachmentIndex& attachment : (*reader)->attachments()) {
    v1::LogAttachment& told = *out.add_attachments();
    told.set_name(attachment.name);
    told.set_media_type(attachment.media_type);
    told.set_bytes(attachment.data_size);
  }
  for (const mcap::MetadataIndex& index : (*reader)->metadata()) {
    const auto record = (*reader)->ReadMetadata(index);
    if (!record) continue;
    for (const auto& [key, value] : record->metadata)
      (*out.mutable_metadata())[index.name + "." + key] = value;
  }
  ForEach<v1::RecordingLoss>(**reader, TopicKind::kLosses, [&](v1::RecordingLoss loss) {
    return *out.add_losses() = std::move(loss), true;
  });
  ForEach<v1::Arm>(**reader, TopicKind::kArm,
                   [&](v1::Arm arm) { return *out.mutable_arm() = std::move(arm), false; });
  return out;
}

}  // namespace taclink::server
