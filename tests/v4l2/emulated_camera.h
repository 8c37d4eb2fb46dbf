#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "tests/v4l2/usb_port.h"
#include "tests/v4l2/uvc_controls.h"

namespace taclink::testing {

/// The picture that a camera takes at a time (CLOCK_MONOTONIC), in one of the formats of uvc_descriptors.h;
/// it must stay where it is.
using PictureAt = std::function<std::span<const uint8_t>(int64_t exposure_ns, uint8_t format)>;

/// What goes wrong with the next pictures.
enum class Damage {
  kNone,
  kErrorBit,  ///< the camera says that the picture is bad
  kShort,     ///< the second half is missing
  kCorrupt,   ///< a part of the bytes is others
};

/// A USB camera made of this process, under the kernel's own uvcvideo driver. Exposes at whole multiples of
/// its frame interval, so that several expose at the same times. All methods may be called from any thread.
class EmulatedCamera {
 public:
  EmulatedCamera(std::string serial, PictureAt picture_at);
  ~EmulatedCamera();
  EmulatedCamera(const EmulatedCamera&) = delete;
  EmulatedCamera& operator=(const EmulatedCamera&) = delete;

  /// Into a port of the virtual hub, from 0, with the settings it is made with; returns when it is done.
  /// Empty: well; else what failed.
  std::string Plug(int port);
  void Unplug();
  /// It answers, but gives no pictures.
  void Stall(bool stalled);
  /// Of the next so many pictures.
  void Spoil(Damage damage, int pictures);

  /// As the driver has set it.
  UvcSettings settings();

  uint64_t pictures_sent() const;

 private:
  struct Streaming {
    bool on = false;
    uint8_t format = 1, size = 1;
    uint32_t interval_100ns = 0;
    int64_t next_ns = 0;  // exposure
  };

  void Run(const std::stop_token& stop);
  void Do(const std::function<void()>& command);
  void Wake() const;
  int64_t UntilNextNs() const;
  void Serve();
  bool HandleControl(const UsbRequest& request);
  bool HandleStandard(const UsbRequest& request);
  bool HandleVideo(const UsbRequest& request);
  bool HandleSetting(const UsbRequest& request);
  void SettleProbe();
  void StartStreaming();
  void Expose();
  bool SendParts();
  void Lost();

  const std::string serial_;
  const PictureAt picture_at_;
  int wake_ = -1;

  // Used by the thread only.
  UsbPort port_;
  std::array<uint8_t, 26> probe_{};
  Streaming streaming_;
  UvcSettings settings_;
  bool stalled_ = false;
  Damage damage_ = Damage::kNone;
  int damaged_left_ = 0;
  std::deque<UsbRequest> waiting_;  // for parts of a picture
  std::vector<uint8_t> picture_;    // being sent
  size_t sent_ = 0;
  bool sending_ = false, with_error_bit_ = false;
  uint8_t frame_bit_ = 0;

  mutable std::mutex mutex_;
  std::condition_variable done_;
  // Guarded by mutex_.
  std::deque<std::function<void()>> commands_;
  uint64_t commands_given_ = 0, commands_done_ = 0;
  uint64_t pictures_sent_ = 0;

  std::jthread thread_;
};

}  // namespace taclink::testing
