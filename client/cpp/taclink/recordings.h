#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "taclink/client.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::client {

/// Takes a piece of a log that begins at `offset`; `size` is that of the whole log. Returns whether to
/// continue.
using LogSink = std::function<bool(std::string_view data, uint64_t offset, uint64_t size)>;

class ReplayReader;  // taclink/replay.h

/// The server's recordings. A view of the client's connection; it keeps the connection open.
class Recordings {
 public:
  /// Errors: kFailedPrecondition (one is under way; no folder), kInvalidArgument, kNotFound (no such link),
  /// or the error of the folder.
  Result<v1::RecorderStatus> Start(const v1::StartRecordingRequest& request);
  /// Returns when its last log is closed. Errors: kFailedPrecondition (none is under way).
  Result<v1::RecorderStatus> Stop();
  Result<v1::RecorderStatus> Status();
  /// The logs in the server's folder, oldest first.
  Result<v1::ListLogsResponse> List();
  /// Errors: kNotFound, kFailedPrecondition (being written).
  Result<void> Delete(const std::string& log);
  /// From byte `offset` on, piece after piece. Errors: kNotFound, kEndOfData (offset past the end, or `sink`
  /// wanted no more), kUnavailable (broke off: continue from there).
  Result<void> Download(const std::string& log, uint64_t offset, const LogSink& sink);
  /// Returns once the server has the log open. Errors: kNotFound (no such log or link), kInvalidArgument
  /// (range, speed), kInternal (the log is damaged beyond reading), kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<ReplayReader>> Replay(
      const v1::ReplayRequest& request,
      std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

 private:
  friend class Client;
  friend class ReplayReader;
  struct Connection;
  explicit Recordings(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}

  std::shared_ptr<Connection> connection_;
};

using Log [[deprecated("use taclink::v1::Log")]] = v1::Log;
using RecorderState [[deprecated("use taclink::v1::RecorderState")]] = v1::RecorderState;
using RecorderStatus [[deprecated("use taclink::v1::RecorderStatus")]] = v1::RecorderStatus;

}  // namespace taclink::client
