#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "taclink/arm_contacts.h"
#include "taclink/client.h"
#include "taclink/events.h"

/// Logs of a TacLINK server, played by it. Times of the log are ns since 1970-01-01 UTC.
namespace taclink::client {

struct ReplayOptions {
  std::string log;                      ///< Log::name
  std::vector<std::string> links = {};  ///< none: all
  Detail detail = Detail::kFull;
  int64_t from_utc_ns = 0;                          ///< 0: the log's first message
  int64_t to_utc_ns = 0;                            ///< 0: its last one
  double speed = 1;                                 ///< 0.1 to 100; 0: as fast as it is read
  bool loop = false;                                ///< begins anew at the end of the range
  bool paused = false;                              ///< begins so, before the first message
  bool events = true, contacts = true, arm = true;  ///< wanted beside the frames
};

/// How the player stands. Sent first, after each order, when the range begins anew, once a second and last.
struct ReplayStatus {
  int64_t from_utc_ns = 0, to_utc_ns = 0;  ///< of the range
  int64_t position_utc_ns = 0;             ///< messages up to here were sent
  double speed = 1;
  bool paused = false;
  bool ended = false;     ///< Next has no more
  uint64_t loops = 0;     ///< the range began anew
  double lateness_s = 0;  ///< latest that a message was sent, since the status before
  uint64_t damaged = 0;   ///< places of the log that could not be read
};

/// Frames of a link that were published but are not in the log.
struct ReplayLoss {
  std::string link;  ///< empty: events or other messages of the whole arm
  uint64_t count = 0;
  uint64_t after_sequence = 0, before_sequence = 0;  ///< of the frames around them; 0: there is none
  std::string text;                                  ///< why, for people
};

struct ReplayMessage {
  std::variant<ReplayStatus, Frame, ArmContacts, Event, Arm, ReplayLoss> content;
  int64_t log_utc_ns = 0;  ///< of the message in the log
};

/// A log that is being played; ends when destroyed. Next from one thread, all else from any.
class ReplayReader {
 public:
  ~ReplayReader();
  ReplayReader(const ReplayReader&) = delete;
  ReplayReader& operator=(const ReplayReader&) = delete;

  /// Waits for the next message; the first one is a status. Frames have Frame::replayed set and, like all
  /// else, their own times. Errors: kTimeout (call again), kEndOfData (the range has ended, or cancelled),
  /// kUnavailable.
  Result<ReplayMessage> Next(std::chrono::milliseconds timeout);
  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

  // Orders. A status tells when one has been carried out. Errors: kNotFound (the call has ended),
  // kInvalidArgument, kUnavailable.
  Result<void> Pause();
  Result<void> Resume();
  /// Bounded by the range. The newest frame of each link before that time comes first.
  Result<void> Seek(int64_t utc_ns);
  Result<void> SetSpeed(double speed);
  /// Pauses, and sends so many frames of the link that has the next one, and what lies between; 1 to 1000.
  Result<void> Step(uint32_t frames = 1);
  Result<void> SetLoop(bool loop);

 private:
  friend class Recordings;
  struct Call;
  explicit ReplayReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

}  // namespace taclink::client
