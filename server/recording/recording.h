#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/arm.h"
#include "server/config_recording.h"
#include "server/rate_limit.h"
#include "server/recording/arm_recorder.h"
#include "server/recording/log_file.h"
#include "server/recording/loss_book.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::server {

struct RecordingOrder {
  std::string name;              ///< part of the logs' names
  std::vector<bool> links = {};  ///< by link; empty: all
  bool pictures = false;
  mcap::Compression compression = mcap::Compression::kZstd;
  std::string note = {};
};

/// One recording from its start to its end: a subscriber of the hub and of the events with a thread of its
/// own. What the disk does not take is counted, and named in the log once it takes something again.
class Recording {
 public:
  /// The first log is there when it returns. The arm must outlive it. Errors: as LogFile::Create.
  static Result<std::unique_ptr<Recording>> Start(Arm& arm, const RecordingConfig& config,
                                                  const RecordingOrder& order, LogPreamble preamble);
  ~Recording();

  /// Takes what waits and closes the log. May be called twice.
  void Stop();
  v1::RecorderStatus Status() const;

 private:
  Recording(Arm& arm, const RecordingConfig& config, RecordingOrder order, LogPreamble preamble);

  Result<std::unique_ptr<LogFile>> NewFile();
  void Run(const std::stop_token& stop);
  void Guarded(const std::function<void()>& step);
  void Drain();
  void TakeFrame(const Publication& publication, const PicturesPtr& pictures);
  void TellLosses(size_t link, uint64_t next_sequence);
  void NoteDrops();
  void Wrote(const Result<void>& written);
  void SyncIfDue(int64_t utc_ns);
  void SplitIfDue();
  void NextFile();
  void CloseFile(LogFile& file);
  void SetTrouble(const std::string& trouble);
  void UpdateStatus();
  int64_t UtcOf(const LinkState& state) const;

  // Constant after construction.
  Arm& arm_;
  const RecordingConfig config_;
  const RecordingOrder order_;
  const LogPreamble preamble_;
  const LogFolder folder_;

  // Used by the thread.
  std::unique_ptr<Subscription> subscription_;
  std::unique_ptr<ArmRecorder> others_;
  std::unique_ptr<LogFile> file_;
  LossBook losses_;
  std::vector<uint64_t> dropped_;  // by link, as counted
  uint64_t dropped_total_ = 0;
  uint64_t chunks_ = 0;  // of file_, that losses_ knows of
  int part_ = 0;
  int failures_ = 0;  // syncs in a row
  int64_t synced_ns_ = 0, quota_ns_ = 0;
  std::string trouble_;
  uint64_t frames_before_ = 0;  // in the logs before file_
  uint64_t bytes_ = 0;          // likewise

  mutable std::mutex mutex_;
  v1::RecorderStatus status_;  // guarded by mutex_

  std::jthread thread_;
};

}  // namespace taclink::server
