#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "taclink/client.h"

namespace taclink::client {

enum class LogCompression { kAsConfigured, kNone, kZstd, kLz4 };

struct RecordingOptions {
  std::string name = {};                ///< part of the logs' names; empty: the arm's
  std::vector<std::string> links = {};  ///< none: all
  bool pictures = false;                ///< also the cameras' pictures
  LogCompression compression = LogCompression::kAsConfigured;
  std::string note = {};
};

enum class RecorderState { kUnknown, kIdle, kRecording, kTrouble };
const char* Name(RecorderState state);  ///< "idle", "recording", "trouble"

/// How the server's recorder does. Times in ns since 1970-01-01 UTC; 0: not yet.
struct RecorderStatus {
  RecorderState state = RecorderState::kUnknown;
  std::string trouble;              ///< what is wrong and what to do; empty: nothing
  std::string last_trouble;         ///< of this recording, also when it is over; empty: none
  int64_t last_trouble_utc_ns = 0;  ///< when it was told
  std::string log;                  ///< that is being written, or was last
  std::string folder;               ///< on the server; empty: none is configured
  int64_t started_utc_ns = 0;
  int64_t synced_utc_ns = 0;  ///< what was written before is safe from a power cut
  uint64_t bytes = 0;         ///< of this recording, over all its logs
  int logs = 0;
  uint64_t frames = 0;
  uint64_t events = 0;
  uint64_t frames_lost = 0;
  uint64_t free_bytes = 0;
  bool pictures = false;
};

struct Log {
  std::string name;
  uint64_t bytes = 0;
  int64_t start_utc_ns = 0;  ///< of the first message, since 1970-01-01; 0: not known
  int64_t end_utc_ns = 0;
  std::vector<std::string> links;
  uint64_t frames = 0;
  std::optional<uint64_t> contacts;  ///< that began; none: not known
  bool pictures = false;
  bool open = false;    ///< being written
  std::string problem;  ///< why it can be read only in part; empty: it is whole
  std::string note;
};

/// Takes a piece of a log at `offset`; false: no more is wanted.
using LogSink = std::function<bool(std::string_view data, uint64_t offset, uint64_t size)>;

class ReplayReader;    // taclink/replay.h
struct ReplayOptions;  // likewise

/// The server's recordings. A view of the client's connection; keeps it open.
class Recordings {
 public:
  /// Errors: kFailedPrecondition (one is under way; no folder), kInvalidArgument, kNotFound (no such link),
  /// or what the folder says.
  Result<RecorderStatus> Start(const RecordingOptions& options);
  /// Returns when its last log is closed. Errors: kFailedPrecondition (none is under way).
  Result<RecorderStatus> Stop();
  Result<RecorderStatus> Status();
  Result<std::vector<Log>> List();
  /// Errors: kNotFound, kFailedPrecondition (being written).
  Result<void> Delete(const std::string& log);
  /// From byte `offset` on, piece after piece. Errors: kNotFound, kEndOfData (offset past the end, or `sink`
  /// wanted no more), kUnavailable (broke off: go on from there).
  Result<void> Download(const std::string& log, uint64_t offset, const LogSink& sink);
  /// Returns once the server has the log open. Errors: kNotFound (no such log or link), kInvalidArgument
  /// (range, speed), kInternal (the log is damaged beyond reading), kResourceExhausted, kUnavailable.
  Result<std::unique_ptr<ReplayReader>> Replay(
      const ReplayOptions& options, std::chrono::milliseconds timeout = Patience(std::chrono::seconds(60)));

 private:
  friend class Client;
  friend class ReplayReader;
  struct Connection;
  explicit Recordings(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}

  std::shared_ptr<Connection> connection_;
};

}  // namespace taclink::client
