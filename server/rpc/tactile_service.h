#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/arm.h"
#include "server/rpc/calibrate_stream.h"
#include "server/rpc/frame_stream.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::server {

struct ServiceLimits {
  size_t max_streams = 64;
  size_t queue_messages = 256;
};

/// taclink.v1.TactileService over a running arm. StreamFrames is raw: its frames are encoded by the hub, once
/// for all streams.
class TactileService final
    : public v1::TactileService::WithCallbackMethod_GetArm<
          v1::TactileService::WithRawCallbackMethod_StreamFrames<
              v1::TactileService::WithCallbackMethod_Calibrate<v1::TactileService::Service>>> {
 public:
  TactileService(Arm& arm, ServiceLimits limits, std::shared_ptr<boost::asio::thread_pool> senders);

  /// Ends all streams with `reason` and refuses new ones.
  void EndStreams(const std::string& reason);
  size_t streams() const { return registry_.streams(); }

 private:
  grpc::ServerUnaryReactor* GetArm(grpc::CallbackServerContext* context, const v1::GetArmRequest* request,
                                   v1::GetArmResponse* response) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* StreamFrames(grpc::CallbackServerContext* context,
                                                           const grpc::ByteBuffer* request) override;
  grpc::ServerWriteReactor<v1::CalibrateResponse>* Calibrate(grpc::CallbackServerContext* context,
                                                             const v1::CalibrateRequest* request) override;

  Result<FrameStreamOptions> ParseRequest(const grpc::ByteBuffer& bytes) const;
  Result<std::vector<bool>> FindLinks(const v1::StreamFramesRequest& request) const;
  Result<size_t> FindLink(const std::string& name) const;

  // Constant after construction.
  Arm& arm_;
  const ServiceLimits limits_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  std::vector<std::string> link_names_;

  StreamRegistry registry_;
  std::mutex calibrations_mutex_;
  // Guarded by calibrations_mutex_: the newest of each link.
  std::vector<std::weak_ptr<CalibrateStream>> calibrations_;
};

}  // namespace taclink::server
