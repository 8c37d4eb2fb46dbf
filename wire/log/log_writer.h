#pragma once

#include <google/protobuf/message.h>

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "mcap/writer.h"
#include "wire/log/topics.h"

namespace taclink::wire::log {

/// When a message came into the log and what happened when, since 1970-01-01 UTC, ns; and its number.
struct Stamp {
  int64_t log_utc_ns = 0;
  int64_t publish_utc_ns = 0;  ///< of frames and pictures: their exposure; 0: as log_utc_ns
  uint64_t sequence = 0;       ///< of frames and pictures: the frame's
};

/// Writes the messages of the arm, each to the channel of its topic and type. For one thread at a time.
class LogWriter {
 public:
  /// Errors: as mcap::Writer::Create.
  static Result<std::unique_ptr<LogWriter>> Create(mcap::ByteSink& sink, mcap::WriterOptions options);

  /// Errors: as mcap::Writer::Write.
  Result<void> Write(const Topic& topic, const google::protobuf::Message& message, const Stamp& stamp);
  /// Serialised already, as `type`. `bytes` may be kept until they are handed to the sink.
  Result<void> Write(const Topic& topic, const google::protobuf::Descriptor& type,
                     std::shared_ptr<const std::string> bytes, const Stamp& stamp);

  Result<void> AddAttachment(const std::string& name, const std::string& media_type, std::string_view data,
                             int64_t utc_ns);
  Result<void> AddMetadata(const std::string& name, mcap::TextMap metadata);

  mcap::Writer& mcap() { return *writer_; }

 private:
  explicit LogWriter(std::unique_ptr<mcap::Writer> writer) : writer_(std::move(writer)) {}
  Result<uint16_t> ChannelOf(const Topic& topic, const google::protobuf::Descriptor& type);

  const std::unique_ptr<mcap::Writer> writer_;
  std::map<std::string, uint16_t> schemas_;                           // by the type's name
  std::map<std::pair<std::string, std::string>, uint16_t> channels_;  // by topic and type's name
};

}  // namespace taclink::wire::log
