#pragma once

#include <grpcpp/support/server_callback.h>

#include <memory>
#include <mutex>
#include <optional>

#include "server/link/link_processor.h"
#include "taclink/v1/tactile.pb.h"

namespace taclink::server {

/// One client's Calibrate call. The worker tells it how the calibration goes; while the client does not read,
/// only the newest progress waits.
class CalibrateStream final : public grpc::ServerWriteReactor<v1::CalibrateResponse>,
                              public std::enable_shared_from_this<CalibrateStream> {
 public:
  /// Lives until gRPC is done with it and no worker holds it. `End` or the worker's calls to `Tell` follow.
  static std::shared_ptr<CalibrateStream> Make();

  /// Ends it with that error, unless it has ended.
  void End(const Error& error);
  /// From the worker's thread. False: the client has gone.
  bool Tell(const CalibrationProgress& progress);

 private:
  CalibrateStream() = default;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  /// Starts the next write if none is under way and there is something to send.
  void Pump();

  std::mutex mutex_;
  // Guarded by mutex_.
  std::shared_ptr<CalibrateStream> self_;  // until gRPC is done
  std::optional<CalibrationProgress> waiting_;
  bool writing_ = false;
  bool cancelled_ = false;
  bool succeeded_ = false;  // the last message, which says so, is made
  bool finished_ = false;
  v1::CalibrateResponse message_;  // under way while writing_
};

}  // namespace taclink::server
