#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/arm/arm.h"
#include "server/config/options.h"
#include "server/hub/rate_limit.h"
#include "server/recording/arm_recorder.h"
#include "server/recording/log_clock.h"
#include "server/recording/log_digest.h"
#include "server/recording/log_file.h"
#include "server/recording/log_folder.h"
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
  /// The first log is there when it returns. The arm must outlive it. Errors: as LogFile::Create,
  /// kResourceExhausted (no thread; then there is no log).
  static Result<std::unique_ptr<Recording>> Start(Arm& arm, const RecordingConfig& config,
                                                  const LogFolder& folder, const RecordingOrder& order,
                                                  LogPreamble preamble);
  ~Recording();

  /// Takes what waits and closes the log. May be called twice.
  void Stop();
  v1::RecorderStatus Status() const;

 private:
  Recording(Arm& arm, const RecordingConfig& config, const LogFolder& folder, RecordingOrder order,
            LogPreamble preamble);

  // What goes wrong, until it is found to be over; text empty: nothing.
  struct Trouble {
    const char* kind;
    std::string text;
  };

  Result<std::unique_ptr<LogFile>> NewFile();
  void Run(const std::stop_token& stop);
  void Guarded(const std::function<void()>& step);
  void Drain(int64_t most_ns);
  void TakeFrame(const Publication& publication, const PicturesPtr& pictures);
  void TellLosses(size_t link, uint64_t next_sequence);
  void NoteDrops();
  void Wrote(const Result<void>& written);
  void LookIfDue();
  std::string Misplaced(const LogFile& file);
  void SyncIfDue();
  bool Sync();
  void SplitIfDue();
  void FollowClock();
  void EnforceQuotaIfDue();
  Result<void> NextFile();
  void CloseFile(LogFile& file);
  void SetTrouble(Trouble& trouble, const std::string& text);
  void TellTrouble(const std::string& kind, const std::string& trouble);
  void UpdateStatus();

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
  LogClock log_clock_;
  LossBook losses_;
  LogDigest digest_;                                 // of file_
  std::vector<uint64_t> dropped_;                    // by link, as counted
  uint64_t dropped_total_ = 0, dropped_synced_ = 0;  // now, and at the last sync
  uint64_t chunks_ = 0;                              // of file_, that losses_ knows of
  int part_ = 0;
  int failures_ = 0;  // syncs in a row
  int64_t synced_ns_ = 0, looked_ns_ = 0, quota_ns_ = 0;
  int64_t written_utc_ns_ = 0;  // what was published until then is with the writer
  Trouble trouble_{.kind = "write", .text = {}}, place_trouble_{.kind = "place", .text = {}},
      split_trouble_{.kind = "split", .text = {}};
  std::map<std::string, int64_t> came_ns_;  // by kind of trouble: when it came last
  bool is_behind_ = false;                  // frames fell out of the queue since the sync before the last
  uint64_t frames_before_ = 0;              // in the logs before file_
  uint64_t bytes_ = 0;                      // likewise

  mutable std::mutex mutex_;
  v1::RecorderStatus status_;  // guarded by mutex_

  std::jthread thread_;
};

}  // namespace taclink::server
