#pragma once

#include <array>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/cpp/taclink/client.h"
#include "sensing/core/clock.h"
#include "server/arm/arm.h"
#include "server/rpc/rpc_server.h"
#include "tests/v4l2/emulated_camera.h"
#include "tests/v4l2/pictures.h"

namespace taclink::testing {

inline constexpr int kRigRateHz = 5;
inline constexpr double kRigForever = 120;  // s; ends a test that hangs, nothing is judged by it

int64_t MonotonicNs();

/// A frame as a client got it.
struct ReceivedFrame {
  v1::LinkFrame frame;
  int64_t received_ns = 0;  ///< monotonic
};

/// Two links, "a" (MJPEG) and "b" (any format: YUYV), each with two emulated cameras named by their serial
/// numbers, a server of this process that runs them, and a client that keeps every frame. The links judge
/// their images as every link does (PictureStage), but find no markers and compute no forces: the guest
/// computes a hundred times slower than a processor.
class Rig {
 public:
  Rig();
  ~Rig();

  /// The camera's number is its port at first: a top, a bottom, b top, b bottom.
  EmulatedCamera& camera(size_t number) { return *cameras_[number]; }
  const Pictures& pictures(CameraId id) const { return pictures_[Index(id)]; }
  /// Empty: it runs; else what failed.
  std::string StartServer();
  v1::Arm Arm();
  client::Client& client() { return *client_; }
  const std::string& address() const { return server_->address(); }
  void StopServer();

  using Wanted = std::function<bool(const v1::LinkFrame&)>;
  /// The first frame of the link, received after that time, that is wanted; waits for it. None: never came.
  std::optional<ReceivedFrame> Await(const std::string& link, int64_t after_ns, const Wanted& wanted);
  /// All of the link with an image, received within.
  std::vector<ReceivedFrame> Frames(const std::string& link, int64_t from_ns, int64_t to_ns);

 private:
  void Receive(const std::stop_token& stop);

  const std::array<Pictures, kCameraCount> pictures_{Pictures(CameraId::kTop, kRigRateHz),
                                                     Pictures(CameraId::kBottom, kRigRateHz)};
  std::vector<std::unique_ptr<EmulatedCamera>> cameras_;
  Clock& clock_ = SystemClock();
  std::unique_ptr<server::Arm> arm_;
  std::unique_ptr<server::RpcServer> server_;
  std::optional<client::Client> client_;
  std::unique_ptr<client::FrameReader> reader_;

  std::mutex mutex_;
  std::condition_variable received_;
  // Guarded by mutex_.
  std::vector<ReceivedFrame> frames_;

  std::jthread receiver_;
};

}  // namespace taclink::testing
