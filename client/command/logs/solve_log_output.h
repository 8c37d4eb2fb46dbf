#pragma once

#include <cstdint>
#include <deque>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/command/logs/solve_log_settings.h"
#include "mcap/file_sink.h"
#include "mcap/reader.h"
#include "sensing/core/result.h"
#include "wire/log/log_writer.h"

namespace taclink::command {

/// The log of new results: messages in the order of the old one, of which some are still being made. It is
/// gone again unless it is closed.
class SolvedLog {
 public:
  /// With the old log's attachments and metadata, but for what was changed. Errors: as mcap::FileSink::Create
  /// and the reader's. What it is given outlives it.
  static Result<std::unique_ptr<SolvedLog>> Create(const SolveLogOptions& options, const mcap::Reader& log,
                                                   const std::vector<LinkSettings>& links);
  ~SolvedLog();

  /// Comes next, on the old message's topic, at its times: these bytes.
  void Add(const mcap::Message& message, std::shared_ptr<const std::string> bytes);
  /// Likewise, still being made from `held` bytes.
  void Add(const mcap::Message& message, std::future<Result<std::string>> bytes, uint64_t held);

  /// Writes from the front what is ready; waits for what is being made while more than `held` bytes wait.
  /// Errors: the writer's, or that of the message.
  Result<void> WriteDown(uint64_t held);
  Result<void> WriteOne();
  uint64_t waiting() const { return waiting_.size(); }  ///< messages

  /// `frames`: that it holds. Errors: the writer's.
  Result<void> Close(uint64_t frames);
  uint64_t bytes() const { return sink_->position(); }

 private:
  struct Waiting {
    mcap::Message message;                     // without data
    std::shared_ptr<const std::string> bytes;  // null: still being made
    std::future<Result<std::string>> being_made;
    uint64_t held = 0;
  };

  SolvedLog(std::string input, const mcap::Reader& log, std::unique_ptr<mcap::FileSink> sink)
      : input_(std::move(input)), log_(log), sink_(std::move(sink)) {}
  Result<void> CopyAttachments(const std::vector<LinkSettings>& links);
  Result<void> CopyMetadata(const SolveLogOptions& options, const std::vector<LinkSettings>& links);
  Result<uint16_t> ChannelOf(uint16_t old);
  Result<uint16_t> SchemaOf(uint16_t channel, uint16_t old);

  // Constant after construction.
  const std::string input_;
  const mcap::Reader& log_;
  const std::unique_ptr<mcap::FileSink> sink_;

  std::unique_ptr<wire::log::LogWriter> writer_;
  std::map<uint16_t, const google::protobuf::Descriptor*>
      fresh_;  // old channels whose messages are made again
  mcap::TextMap totals_;
  std::map<std::string, uint16_t> schemas_;  // by the type, or "#" and the old id
  std::map<uint16_t, uint16_t> channels_;    // by the old id
  std::deque<Waiting> waiting_;
  uint64_t held_ = 0;  // bytes, by those that wait
  bool closed_ = false;
};

}  // namespace taclink::command
