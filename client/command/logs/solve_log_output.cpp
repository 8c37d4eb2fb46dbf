#include "client/command/logs/solve_log_output.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "foxglove/scene.pb.h"
#include "sensing/pipeline/options_text.h"
#include "taclink/v1/arm.pb.h"
#include "taclink/v1/frame.pb.h"
#include "wire/log/schema.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

using wire::log::TopicKind;

constexpr uint64_t kPictureChunkBytes = uint64_t{4} << 20;
constexpr const char* kYaml = "application/yaml";

bool HasPictures(const mcap::Reader& log) {
  return std::any_of(log.channels().begin(), log.channels().end(), [](const auto& channel) {
    const auto topic = wire::log::ParseTopic(channel.second.topic);
    return topic && topic->kind == TopicKind::kPicture;
  });
}

// Pictures hardly become smaller.
mcap::WriterOptions ToWriter(bool pictures) {
  if (pictures) return {.compression = mcap::Compression::kNone, .chunk_bytes = kPictureChunkBytes};
  return {.compression = mcap::Compression::kZstd};
}

// Of messages that are made again, whose fields may be more than the old log knew; null: of copied ones.
const google::protobuf::Descriptor* FreshType(const std::string& topic_text,
                                              const std::vector<LinkSettings>& links) {
  const auto topic = wire::log::ParseTopic(topic_text);
  if (!topic) return nullptr;
  const bool solved =
      std::any_of(links.begin(), links.end(), [&](const auto& link) { return link.name == topic->link; });
  if (solved && topic->kind == TopicKind::kFrame) return v1::LinkFrame::descriptor();
  if (solved && topic->kind == TopicKind::kScene) return foxglove::SceneUpdate::descriptor();
  if (topic->kind == TopicKind::kArm) return v1::Arm::descriptor();
  return nullptr;
}

mcap::TextMap SolvedRecord(const SolveLogOptions& options, const std::vector<LinkSettings>& links) {
  mcap::TextMap record = {{"from", std::filesystem::path(options.input).filename().string()}};
  for (const LinkSettings& link : links) {
    std::string& names = record["links"];
    names += (names.empty() ? "" : ", ") + link.name;
    for (const auto& [what, change] : link.changes) record[link.name + "." + what] = change;
  }
  return record;
}

}  // namespace

Result<std::unique_ptr<SolvedLog>> SolvedLog::Create(const SolveLogOptions& options, const mcap::Reader& log,
                                                     const std::vector<LinkSettings>& links) {
  auto sink = mcap::FileSink::Create(options.output);
  if (!sink) return sink.error();
  std::unique_ptr<SolvedLog> out(new SolvedLog(options.input, log, std::move(*sink)));
  auto writer = wire::log::LogWriter::Create(*out->sink_, ToWriter(options.pictures && HasPictures(log)));
  if (!writer) return writer.error();
  out->writer_ = std::move(*writer);
  for (const auto& [id, channel] : log.channels()) {
    if (const auto* type = FreshType(channel.topic, links)) out->fresh_.emplace(id, type);
  }
  if (auto copied = out->CopyMetadata(options, links); !copied) return copied.error();
  if (auto copied = out->CopyAttachments(links); !copied) return copied.error();
  return out;
}

SolvedLog::~SolvedLog() {
  std::error_code ignored;
  if (!closed_) std::filesystem::remove(sink_->path(), ignored);
}

Result<void> SolvedLog::CopyMetadata(const SolveLogOptions& options, const std::vector<LinkSettings>& links) {
  mcap::TextMap solved = SolvedRecord(options, links);
  std::map<std::string, mcap::TextMap> records;
  for (const mcap::MetadataIndex& index : log_.metadata()) {
    auto record = log_.ReadMetadata(index);
    if (!record) return record.error();
    records[index.name] = std::move(record->metadata);
  }
  for (const LinkSettings& link : links)
    records[wire::log::LinkMetadataName(link.name)] = OptionsText(link.options);
  if (!options.pictures && records.contains(wire::log::kMetadataName))
    records[wire::log::kMetadataName]["pictures"] = "false";
  for (const auto& [key, value] : records[wire::log::kSolvedName]) solved["before." + key] = value;
  records[wire::log::kSolvedName] = std::move(solved);
  totals_ = std::move(records[wire::log::kTotalsName]);
  records.erase(wire::log::kTotalsName);
  for (const auto& [name, record] : records) {
    if (auto added = writer_->AddMetadata(name, record); !added) return added.error();
  }
  return {};
}

Result<void> SolvedLog::CopyAttachments(const std::vector<LinkSettings>& links) {
  std::map<std::string, const std::string*> replaced;
  for (const LinkSettings& link : links) {
    if (link.new_model) replaced[wire::log::ModelAttachment(link.name)] = &*link.new_model;
    if (link.new_calibration) replaced[wire::log::CalibrationAttachment(link.name)] = &*link.new_calibration;
  }
  mcap::Buffer buffer;
  for (const mcap::AttachmentIndex& index : log_.attachments()) {
    if (replaced.contains(index.name) || index.name == wire::log::kSummaryName) continue;
    const auto attachment = log_.ReadAttachment(index, buffer);
    if (!attachment) return attachment.error();
    if (auto added = writer_->mcap().AddAttachment(*attachment); !added) return added.error();
  }
  const auto start_ns = static_cast<int64_t>(log_.statistics().message_start_ns);
  for (const auto& [name, text] : replaced) {
    if (auto added = writer_->AddAttachment(name, kYaml, *text, start_ns); !added) return added.error();
  }
  return {};
}

Result<uint16_t> SolvedLog::SchemaOf(uint16_t channel, uint16_t old) {
  const auto fresh = fresh_.find(channel);
  const std::string key = fresh != fresh_.end() ? fresh->second->full_name() : "#" + std::to_string(old);
  if (const auto known = schemas_.find(key); known != schemas_.end()) return known->second;
  mcap::Schema schema;
  if (fresh != fresh_.end()) {
    schema = wire::log::ProtobufSchema(*fresh->second);
  } else if (const auto at = log_.schemas().find(old); at != log_.schemas().end()) {
    schema = at->second;
  } else {
    return uint16_t{0};  // none
  }
  const auto id = writer_->mcap().AddSchema(std::move(schema));
  if (id) schemas_.emplace(key, *id);
  return id;
}

Result<uint16_t> SolvedLog::ChannelOf(uint16_t old) {
  if (const auto known = channels_.find(old); known != channels_.end()) return known->second;
  mcap::Channel channel = log_.channels().at(old);
  const auto schema = SchemaOf(old, channel.schema_id);
  if (!schema) return schema.error();
  channel.schema_id = *schema;
  const auto id = writer_->mcap().AddChannel(std::move(channel));
  if (id) channels_.emplace(old, *id);
  return id;
}

void SolvedLog::Add(const mcap::Message& message, std::shared_ptr<const std::string> bytes) {
  const uint64_t held = bytes->size();
  held_ += held;
  waiting_.push_back({.message = message, .bytes = std::move(bytes), .being_made = {}, .held = held});
}

void SolvedLog::Add(const mcap::Message& message, std::future<Result<std::string>> bytes, uint64_t held) {
  held_ += held;
  waiting_.push_back({.message = message, .bytes = {}, .being_made = std::move(bytes), .held = held});
}

Result<void> SolvedLog::WriteDown(uint64_t held) {
  const auto ready = [](const Waiting& front) {
    return front.bytes || front.being_made.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  while (held_ > held || (!waiting_.empty() && ready(waiting_.front()))) {
    if (auto written = WriteOne(); !written) return written.error();
  }
  return {};
}

Result<void> SolvedLog::WriteOne() {
  Waiting next = std::move(waiting_.front());
  waiting_.pop_front();
  held_ -= next.held;
  if (!next.bytes) {
    auto made = next.being_made.get();
    if (!made) return Error{made.error().code, input_ + ": " + made.error().message};
    next.bytes = std::make_shared<const std::string>(std::move(*made));
  }
  const auto channel = ChannelOf(next.message.channel_id);
  if (!channel) return channel.error();
  next.message.channel_id = *channel;
  next.message.data = mcap::AsBytes(*next.bytes);
  return writer_->mcap().Write(next.message, next.bytes);
}

Result<void> SolvedLog::Close(uint64_t frames) {
  if (auto flushed = writer_->mcap().Flush(); !flushed) return flushed.error();
  totals_.erase("contacts");  // of the old results
  totals_["frames"] = std::to_string(frames);
  if (auto added = writer_->AddMetadata(wire::log::kTotalsName, totals_); !added) return added.error();
  if (auto ended = writer_->mcap().Close(); !ended) return ended.error();
  if (auto synced = sink_->Sync(); !synced) return synced.error();
  closed_ = true;
  return {};
}

}  // namespace taclink::command
