#include "tests/mcap/judge.h"

#include <gtest/gtest.h>
#include <openssl/sha.h>

#include <array>
#include <map>
#include <memory>

#include "tests/mcap/log_content.h"
#include "tests/support/process.h"

namespace taclink::mcap::testing {
namespace {

using nlohmann::json;

std::string Hex(const unsigned char* bytes, size_t size) {
  std::string text;
  for (size_t i = 0; i < size; ++i) {
    text += "0123456789abcdef"[bytes[i] >> 4];
    text += "0123456789abcdef"[bytes[i] & 15];
  }
  return text;
}

std::string Sha256(std::string_view bytes) {
  std::array<unsigned char, SHA256_DIGEST_LENGTH> hash{};
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(), hash.data());
  return Hex(hash.data(), hash.size());
}

struct Topic {
  uint64_t count = 0;
  uint64_t log_times = 0;
  std::string type;
  std::string bytes;
};

void AddMessage(const Message& message, const Reader& reader, std::map<std::string, Topic>& topics) {
  const Channel& channel = reader.channels().at(message.channel_id);
  Topic& topic = topics[channel.topic];
  if (topic.count == 0 && channel.schema_id != 0) {
    const Schema& schema = reader.schemas().at(channel.schema_id);
    topic.type = schema.name + " " + schema.encoding + " " + Sha256(schema.data);
  }
  ++topic.count;
  topic.log_times += message.log_time_ns;
  Buffer prefix;
  AppendNumber(message.sequence, prefix);
  AppendNumber(message.log_time_ns, prefix);
  AppendNumber(message.publish_time_ns, prefix);
  AppendNumber(static_cast<uint32_t>(message.data.size()), prefix);
  topic.bytes += Text(prefix) + Text(message.data);
}

}  // namespace

json DigestOf(Bytes bytes, MessageOrder order) {
  const auto reader = Reader::Open(std::make_shared<MemorySource>(bytes));
  if (!reader) return {{"error", reader.error().message}};
  std::map<std::string, Topic> topics;
  MessageCursor cursor(**reader, {.order = order});
  auto message = cursor.Next();
  for (; message.ok(); message = cursor.Next()) AddMessage(*message, **reader, topics);
  if (message.error().code != ErrorCode::kEndOfData) return {{"error", message.error().message}};

  json out = {
      {"header", {{"profile", (*reader)->header().profile}, {"library", (*reader)->header().library}}},
      {"topics", json::object()},
      {"attachments", json::array()},
      {"metadata", json::array()}};
  for (const auto& [name, topic] : topics) {
    out["topics"][name] = {{"count", topic.count},
                           {"logTimes", std::to_string(topic.log_times)},
                           {"type", topic.type},
                           {"sha256", Sha256(topic.bytes)}};
  }
  Buffer buffer;
  for (const AttachmentIndex& index : (*reader)->attachments()) {
    const auto attachment = (*reader)->ReadAttachment(index, buffer);
    if (!attachment) return {{"error", attachment.error().message}};
    out["attachments"].push_back(
        {attachment->name, attachment->media_type, std::to_string(attachment->log_time_ns),
         std::to_string(attachment->create_time_ns), Sha256(Text(attachment->data))});
  }
  for (const MetadataIndex& index : (*reader)->metadata()) {
    const auto metadata = (*reader)->ReadMetadata(index);
    if (!metadata) return {{"error", metadata.error().message}};
    out["metadata"].push_back({metadata->name, json(metadata->metadata)});
  }
  return out;
}

json RunJudge(const std::string& mode, const std::filesystem::path& folder) {
  const auto run =
      taclink::testing::RunToEnd({"/usr/bin/env", "-C", JUDGE_PACKAGES, "node", JUDGE, mode, folder});
  EXPECT_EQ(run.exit_code, 0) << "node does not run the judge (is it installed?): " << run.err;
  return run.exit_code == 0 ? json::parse(run.out) : json();
}

}  // namespace taclink::mcap::testing
