#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "sensing/core/clock.h"
#include "server/replay/log_channels.h"
#include "server/replay/log_gaps.h"

namespace taclink::server {

/// When the messages of a log are due that plays round after round, for all who play a part of it. Any
/// thread.
class ReplaySchedule {
 public:
  /// Log times, ns since 1970-01-01 UTC.
  ReplaySchedule(int64_t from_utc_ns, int64_t to_utc_ns, Clock& clock, LogGaps gaps = {});

  /// The first call begins the first round. Before that nothing else may be asked.
  void Begin();
  /// Monotonic time.
  int64_t DueNs(uint64_t round, int64_t log_utc_ns) const;

  struct Place {
    uint64_t round = 0;
    int64_t log_utc_ns = 0;
  };
  Place Now() const;
  int64_t PassedNs() const;  ///< since the first round began
  /// A player has come to this round. Said in the server's log, once.
  void Reached(uint64_t round);

 private:
  // Constant after construction.
  const LogGaps gaps_;
  const int64_t from_ns_, length_ns_;  // as LogGaps counts
  Clock& clock_;

  std::atomic<int64_t> start_ns_ = 0;  // monotonic; 0: not begun
  std::atomic<uint64_t> round_ = 0;
};

/// Some channels of a log, round after round. One thread.
class ReplayTrack {
 public:
  struct Item {
    int64_t due_ns = 0;     ///< monotonic
    mcap::Bytes data = {};  ///< valid until the next call
  };

  /// From where the schedule is now. Errors: as ChooseChannels and LogPlayer::Open.
  static Result<std::unique_ptr<ReplayTrack>> Open(std::shared_ptr<const mcap::Reader> reader,
                                                   const LogSelection& selection,
                                                   std::shared_ptr<ReplaySchedule> schedule);

  /// The next message, long before it is due as well as long after. Errors: kEndOfData (there are none at
  /// all).
  Result<Item> Next();
  /// To where the schedule is now; the newest message before that comes first.
  void CatchUp();

 private:
  ReplayTrack(std::unique_ptr<LogPlayer> player, std::shared_ptr<ReplaySchedule> schedule)
      : player_(std::move(player)), schedule_(std::move(schedule)) {}

  const std::unique_ptr<LogPlayer> player_;
  const std::shared_ptr<ReplaySchedule> schedule_;
  uint64_t round_ = 0;
};

}  // namespace taclink::server
