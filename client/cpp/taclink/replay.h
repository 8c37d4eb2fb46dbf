#pragma once

#include <chrono>
#include <cstdint>
#include <memory>

#include "taclink/result.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::client {

/// A log that is being played; it ends when destroyed. Call Next from one thread, all else from any.
class ReplayReader {
 public:
  ~ReplayReader();
  ReplayReader(const ReplayReader&) = delete;
  ReplayReader& operator=(const ReplayReader&) = delete;

  /// Waits for the next message; the first one is a status. Frames have LinkFrame.replayed set and, like all
  /// else, the times of the log. A newer server may send messages whose message_case() is MESSAGE_NOT_SET:
  /// ignore them. Errors: kTimeout (call again), kEndOfData (the range has ended, or cancelled),
  /// kUnavailable.
  Result<v1::ReplayResponse> Next(std::chrono::milliseconds timeout);
  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

  // Orders. A status reports when one has been carried out. Errors: kNotFound (the call has ended),
  // kInvalidArgument, kUnavailable.
  Result<void> Pause();
  Result<void> Resume();
  /// Bounded by the range. The newest frame of each link before that time comes first.
  Result<void> Seek(int64_t utc_ns);
  /// 0.1 to 100; 0: as fast as the client reads.
  Result<void> SetSpeed(double speed);
  /// Pauses, and sends so many frames of the link that has the next one, and the messages between; 1 to 1000.
  Result<void> Step(uint32_t frames = 1);
  Result<void> SetLoop(bool loop);

 private:
  friend class Recordings;
  struct Call;
  explicit ReplayReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

using ReplayLoss [[deprecated("use taclink::v1::RecordingLoss")]] = v1::RecordingLoss;
using ReplayMessage [[deprecated("use taclink::v1::ReplayResponse")]] = v1::ReplayResponse;
using ReplayStatus [[deprecated("use taclink::v1::ReplayStatus")]] = v1::ReplayStatus;

}  // namespace taclink::client
