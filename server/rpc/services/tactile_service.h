#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/arm/arm.h"
#include "server/rpc/requests/service_limits.h"
#include "server/rpc/services/joint_state_call.h"
#include "server/rpc/services/link_update_calls.h"
#include "server/rpc/services/tare_call.h"
#include "server/rpc/streams/calibrate_stream.h"
#include "server/rpc/streams/contact_stream.h"
#include "server/rpc/streams/frame_stream.h"
#include "server/rpc/streams/open_calls.h"
#include "server/rpc/streams/stream_registry.h"
#include "server/security/security.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::server {

/// taclink.v1.TactileService over a running arm. Raw are StreamFrames, whose frames the hub encodes once
/// for all streams, other streams that the server encodes itself, and the calls that feed it (see
/// UpdateStream).
class TactileService final
    : public v1::TactileService::WithCallbackMethod_GetArm<
          v1::TactileService::WithCallbackMethod_GetForceHistory<
              v1::TactileService::WithRawCallbackMethod_StreamFrames<
                  v1::TactileService::WithCallbackMethod_Calibrate<
                      v1::TactileService::WithCallbackMethod_Tare<
                          v1::TactileService::WithRawCallbackMethod_StreamContacts<
                              v1::TactileService::WithRawCallbackMethod_UpdateJointStates<
                                  v1::TactileService::WithRawCallbackMethod_UpdatePressure<
                                      v1::TactileService::WithRawCallbackMethod_UpdateAttitude<
                                          v1::TactileService::WithRawCallbackMethod_StreamEvents<
                                              v1::TactileService::WithCallbackMethod_SetThresholds<
                                                  v1::TactileService::WithRawCallbackMethod_StreamPreview<
                                                      v1::TactileService::WithCallbackMethod_SetForceModel<
                                                          v1::TactileService::WithCallbackMethod_SetCamera<
                                                              v1::TactileService::Service>>>>>>>>>>>>>> {
 public:
  TactileService(Arm& arm, ServiceLimits limits, std::shared_ptr<boost::asio::thread_pool> senders,
                 std::shared_ptr<const Security> security);

  /// Ends all streams with `reason` and refuses new ones.
  void EndStreams(const std::string& reason);
  StreamRegistry& registry() { return registry_; }
  size_t streams() const { return registry_.streams(); }
  void WaitUntilNoStreams(std::chrono::milliseconds patience) const { registry_.WaitUntilEmpty(patience); }
  /// Of streams that begin from now on.
  void SetLimits(ServiceLimits limits);
  /// Waits for what is done aside. Only once no call can come any more.
  void Join() { aside_->join(); }

 private:
  grpc::ServerUnaryReactor* GetArm(grpc::CallbackServerContext* context, const v1::GetArmRequest* request,
                                   v1::GetArmResponse* response) override;
  grpc::ServerUnaryReactor* GetForceHistory(grpc::CallbackServerContext* context,
                                            const v1::GetForceHistoryRequest* request,
                                            v1::GetForceHistoryResponse* response) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* StreamFrames(grpc::CallbackServerContext* context,
                                                           const grpc::ByteBuffer* request) override;
  grpc::ServerWriteReactor<v1::CalibrateResponse>* Calibrate(grpc::CallbackServerContext* context,
                                                             const v1::CalibrateRequest* request) override;

  grpc::ServerUnaryReactor* Tare(grpc::CallbackServerContext* context, const v1::TareRequest* request,
                                 v1::TareResponse* response) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* StreamContacts(grpc::CallbackServerContext* context,
                                                             const grpc::ByteBuffer* request) override;
  grpc::ServerReadReactor<grpc::ByteBuffer>* UpdateJointStates(grpc::CallbackServerContext* context,
                                                               grpc::ByteBuffer* response) override;
  grpc::ServerReadReactor<grpc::ByteBuffer>* UpdatePressure(grpc::CallbackServerContext* context,
                                                            grpc::ByteBuffer* response) override;

  grpc::ServerReadReactor<grpc::ByteBuffer>* UpdateAttitude(grpc::CallbackServerContext* context,
                                                            grpc::ByteBuffer* response) override;

  grpc::ServerWriteReactor<grpc::ByteBuffer>* StreamEvents(grpc::CallbackServerContext* context,
                                                           const grpc::ByteBuffer* request) override;
  grpc::ServerUnaryReactor* SetThresholds(grpc::CallbackServerContext* context,
                                          const v1::SetThresholdsRequest* request,
                                          v1::SetThresholdsResponse* response) override;

  grpc::ServerWriteReactor<grpc::ByteBuffer>* StreamPreview(grpc::CallbackServerContext* context,
                                                            const grpc::ByteBuffer* request) override;
  grpc::ServerUnaryReactor* SetForceModel(grpc::CallbackServerContext* context,
                                          const v1::SetForceModelRequest* request,
                                          v1::SetForceModelResponse* response) override;
  grpc::ServerUnaryReactor* SetCamera(grpc::CallbackServerContext* context,
                                      const v1::SetCameraRequest* request,
                                      v1::SetCameraResponse* response) override;

  Result<void> OrderCalibration(const std::string& who, const v1::CalibrateRequest& request,
                                const std::shared_ptr<CalibrateStream>& stream);
  ServiceLimits limits() const;
  /// Null: added. Else the refused call.
  grpc::ServerWriteReactor<grpc::ByteBuffer>* AddOrRefuse(const grpc::CallbackServerContext& context,
                                                          const char* method,
                                                          std::shared_ptr<PumpedStream> stream);

  // Constant after construction.
  Arm& arm_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  const std::shared_ptr<const Security> security_;
  /// For what takes long and nobody's frames wait for: pictures for people, force models.
  const std::shared_ptr<boost::asio::thread_pool> aside_ = std::make_shared<boost::asio::thread_pool>(1);
  std::vector<std::string> link_names_;

  StreamRegistry registry_;
  UpdateRegistry updates_;
  mutable std::mutex limits_mutex_;
  ServiceLimits limits_;  // guarded by limits_mutex_
  OpenCalls<CalibrateStream> calibrations_;
  OpenCalls<TareCall> tares_;
};

}  // namespace taclink::server
