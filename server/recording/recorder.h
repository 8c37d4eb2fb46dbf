#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "server/arm/arm.h"
#include "server/config/options.h"
#include "server/recording/log_catalog.h"
#include "server/recording/recording.h"

namespace taclink::server {

/// The server's recordings: one at a time. Any thread; all but Status may wait for the disk.
class Recorder {
 public:
  /// `preamble`: what every log begins with. The arm and `calls` must outlive it.
  Recorder(Arm& arm, const RecordingConfig& config, LogPreamble preamble,
           mcap::FileCalls& calls = mcap::FileCalls::System());
  ~Recorder();

  /// Ends the recording that is under way, if any.
  void Close();

  /// Looks at the folder, begins to recover logs that a killed server has left open, and begins the recording
  /// that the configuration asks for. What fails is logged: sensing goes on without it. Not for a server that
  /// plays a log: it changes nothing in the folder unless an operator records.
  void Open();
  /// Errors: kFailedPrecondition (one is under way, no folder), kInvalidArgument, kNotFound (no such link),
  /// or what the folder says.
  Result<v1::RecorderStatus> Start(const v1::StartRecordingRequest& request, const std::string& who);
  /// Errors: kFailedPrecondition (none is under way).
  Result<v1::RecorderStatus> Stop(const std::string& who);
  v1::RecorderStatus Status() const;

  const LogFolder& folder() const { return folder_; }
  LogCatalog& catalog() { return catalog_; }

 private:
  Result<RecordingOrder> ToOrder(const v1::StartRecordingRequest& request) const;
  Result<void> CheckFolder() const;

  // Constant after construction.
  Arm& arm_;
  const RecordingConfig config_;
  const LogPreamble preamble_;
  const LogFolder folder_;

  LogCatalog catalog_;      // has its own lock
  std::mutex order_mutex_;  // one start or stop at a time
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::shared_ptr<Recording> recording_;  // null: none
  v1::RecorderStatus last_;               // of the one before

  std::jthread mender_;
};

}  // namespace taclink::server
