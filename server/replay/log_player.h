#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "mcap/cursor.h"
#include "mcap/reader.h"
#include "server/replay/log_gaps.h"

namespace taclink::server {

/// What the messages of a channel are to a player.
struct PlayedChannel {
  bool frame = false;  ///< steps count them
  bool state = false;  ///< each holds until the next: the newest one before a seek is sent at once
};

struct PlayerOptions {
  std::map<uint16_t, PlayedChannel> channels = {};  ///< all others are left out
  // Log times, ns since 1970-01-01 UTC, both ends included; bounded by the log's first and last message.
  int64_t from_utc_ns = 0;
  int64_t to_utc_ns = 0;  ///< 0: the log's end
  double speed = 1;       ///< kSlowest to kFastest times as fast as it happened; 0: whenever it is asked
  bool loop = false;      ///< begins again at the end of the range
  bool paused = false;    ///< begins so, before the first message
};

struct PlayerStatus {
  int64_t from_utc_ns = 0, to_utc_ns = 0;  ///< of the range
  int64_t position_utc_ns = 0;             ///< messages up to here were given out
  double speed = 1;
  bool paused = false;
  bool ended = false;
  uint64_t loops = 0;    ///< the range began again
  uint64_t damaged = 0;  ///< places that could not be read
};

/// What a player has to say. Times are those of the clock whose times Next is given.
struct PlayerStep {
  enum class Kind {
    kMessage,
    kWait,       ///< until due_ns
    kPaused,     ///< until an order
    kBegunAnew,  ///< the range; ask again
    kEnded,
  };
  Kind kind = Kind::kEnded;
  std::optional<int64_t> due_ns = {};  ///< none, with a message: it had no due time
  uint16_t channel = 0;                ///< with a message, also what follows
  int64_t log_utc_ns = 0;
  mcap::Bytes data = {};  ///< valid until the next call
};

/// Plays a log's messages in the order of their log times. Holds no thread and no clock: whoever calls Next
/// with the time gets what is due, or is told when to come again. Who comes late gets all the same, late.
/// Long times without messages are played as a short pause (LogGaps).
/// What can't be read is counted and passed over. One thread; reads the log's source.
class LogPlayer {
 public:
  static constexpr double kSlowest = 0.1, kFastest = 100;
  static constexpr int64_t kLookBackNs = 2'000'000'000;  ///< for states before a seek
  static constexpr uint32_t kMostSteps = 1000;

  /// Errors: kInvalidArgument.
  static Result<void> CheckSpeed(double speed);
  /// Errors: kInvalidArgument (speed, an empty range).
  static Result<std::unique_ptr<LogPlayer>> Open(std::shared_ptr<const mcap::Reader> reader,
                                                 PlayerOptions options);

  /// The schedule begins with the first call that is not paused.
  PlayerStep Next(int64_t now_ns);

  void Pause(int64_t now_ns);
  void Resume();
  /// Errors: kInvalidArgument.
  Result<void> SetSpeed(double speed, int64_t now_ns);
  /// Goes on from there, which is bounded by the range; before that gives the newest states, as far as they
  /// are within the range and kLookBackNs before, also while paused.
  void Seek(int64_t utc_ns);
  /// Pauses, and gives out all messages up to the `frames`-th frame of the channel that has the next one.
  /// Errors: kInvalidArgument (not 1 to kMostSteps).
  Result<void> Step(uint32_t frames, int64_t now_ns);
  void SetLoop(bool loop) { options_.loop = loop; }

  PlayerStatus status() const;

 private:
  struct State {
    uint16_t channel = 0;
    int64_t log_utc_ns = 0;
    mcap::Buffer data;
  };
  struct Anchor {
    int64_t played_ns = 0;  // as LogGaps counts
    int64_t clock_ns = 0;
  };

  LogPlayer(std::shared_ptr<const mcap::Reader> reader, PlayerOptions options);

  void OpenCursor(int64_t start_utc_ns);
  void FindStates(int64_t before_utc_ns);
  bool Fetch();
  PlayerStep Give(const mcap::Message& message, std::optional<int64_t> due_ns);
  PlayerStep AtEnd(int64_t now_ns);
  PlayerStep BeginAnew();
  void CountStep(uint16_t channel);
  int64_t Due(int64_t log_utc_ns) const;
  int64_t LogTimeAt(int64_t now_ns);
  void AnchorAt(int64_t now_ns);

  // Constant after construction.
  const std::shared_ptr<const mcap::Reader> reader_;
  const LogGaps gaps_;

  PlayerOptions options_;  // speed and loop may change; the range is that of the status
  std::unique_ptr<mcap::MessageCursor> cursor_;
  std::optional<mcap::Message> next_;  // read already
  bool exhausted_ = false;             // the cursor has no more
  std::vector<State> states_;          // to be given out first, taken from the back
  mcap::Buffer given_;                 // the last one's data

  int64_t head_utc_ns_ = 0;       // playing goes on from here
  std::optional<Anchor> anchor_;  // none: the next call sets it
  int64_t position_utc_ns_ = 0;
  bool paused_ = false;
  uint32_t steps_ = 0;                    // frames yet to be given out while paused
  std::optional<uint16_t> step_channel_;  // none: that of the next frame
  bool ended_ = false;
  bool fruitful_ = false;  // this round had a message, or may have
  uint64_t loops_ = 0;
  uint64_t damaged_in_scan_ = 0;
  std::set<std::string> damage_;  // as each place's error tells it
};

}  // namespace taclink::server
