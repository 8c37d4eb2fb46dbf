#include "wire/log/log_writer.h"

#include "wire/log/schema.h"

namespace taclink::wire::log {

using google::protobuf::Descriptor;

Result<std::unique_ptr<LogWriter>> LogWriter::Create(mcap::ByteSink& sink, mcap::WriterOptions options) {
  auto writer = mcap::Writer::Create(sink, std::move(options));
  if (!writer) return writer.error();
  return std::unique_ptr<LogWriter>(new LogWriter(std::move(*writer)));
}

Result<uint16_t> LogWriter::ChannelOf(const Topic& topic, const Descriptor& type) {
  const std::pair key(ToText(topic), type.full_name());
  if (const auto known = channels_.find(key); known != channels_.end()) return known->second;
  auto schema = schemas_.find(type.full_name());
  if (schema == schemas_.end()) {
    const auto id = writer_->AddSchema(ProtobufSchema(type));
    if (!id) return id.error();
    schema = schemas_.emplace(type.full_name(), *id).first;
  }
  mcap::TextMap metadata;
  if (!topic.link.empty()) metadata["link"] = topic.link;
  const auto channel = writer_->AddChannel({.schema_id = schema->second,
                                            .topic = key.first,
                                            .message_encoding = "protobuf",
                                            .metadata = std::move(metadata)});
  if (channel) channels_.emplace(key, *channel);
  return channel;
}

Result<void> LogWriter::Write(const Topic& topic, const google::protobuf::Message& message,
                              const Stamp& stamp) {
  return Write(topic, *message.GetDescriptor(),
               std::make_shared<const std::string>(message.SerializeAsString()), stamp);
}

Result<void> LogWriter::Write(const Topic& topic, const Descriptor& type,
                              std::shared_ptr<const std::string> bytes, const Stamp& stamp) {
  const auto channel = ChannelOf(topic, type);
  if (!channel) return channel.error();
  const auto publish = stamp.publish_utc_ns == 0 ? stamp.log_utc_ns : stamp.publish_utc_ns;
  const mcap::Message message{.channel_id = *channel,
                              .sequence = static_cast<uint32_t>(stamp.sequence),
                              .log_time_ns = static_cast<uint64_t>(stamp.log_utc_ns),
                              .publish_time_ns = static_cast<uint64_t>(publish),
                              .data = mcap::AsBytes(*bytes)};
  return writer_->Write(message, std::move(bytes));
}

Result<void> LogWriter::AddAttachment(const std::string& name, const std::string& media_type,
                                      std::string_view data, int64_t utc_ns) {
  return writer_->AddAttachment({.log_time_ns = static_cast<uint64_t>(utc_ns),
                                 .create_time_ns = static_cast<uint64_t>(utc_ns),
                                 .name = name,
                                 .media_type = media_type,
                                 .data = mcap::AsBytes(data)});
}

Result<void> LogWriter::AddMetadata(const std::string& name, mcap::TextMap metadata) {
  return writer_->AddMetadata({.name = name, .metadata = std::move(metadata)});
}

}  // namespace taclink::wire::log
