#pragma once

#include <boost/asio/thread_pool.hpp>
#include <memory>
#include <string>

#include "server/acceptance/trial_measurement.h"
#include "server/arm/arm.h"
#include "server/rpc/streams/open_calls.h"
#include "server/security/security.h"
#include "taclink/v1/acceptance.grpc.pb.h"

namespace taclink::server {

/// taclink.v1.AcceptanceService over a running arm, which must outlive it. Calls are answered on a thread of
/// its own: they wait for the disk.
class AcceptanceService final : public v1::AcceptanceService::WithCallbackMethod_StartAcceptance<
                                    v1::AcceptanceService::WithCallbackMethod_MeasureTrial<
                                        v1::AcceptanceService::WithCallbackMethod_SkipTrial<
                                            v1::AcceptanceService::WithCallbackMethod_FinishAcceptance<
                                                v1::AcceptanceService::WithCallbackMethod_GetAcceptance<
                                                    v1::AcceptanceService::Service>>>>> {
 public:
  AcceptanceService(Arm& arm, std::shared_ptr<const Security> security)
      : arm_(arm), security_(std::move(security)) {}

  /// Ends the measurements under way with `reason` and refuses new ones.
  void EndCalls(const std::string& reason) { measurements_.Close(reason); }
  /// Only once no call can come any more.
  void Join() { pool_.join(); }

 private:
  using Context = grpc::CallbackServerContext;

  grpc::ServerUnaryReactor* StartAcceptance(Context* context, const v1::StartAcceptanceRequest* request,
                                            v1::StartAcceptanceResponse* response) override;
  grpc::ServerUnaryReactor* MeasureTrial(Context* context, const v1::MeasureTrialRequest* request,
                                         v1::MeasureTrialResponse* response) override;
  grpc::ServerUnaryReactor* SkipTrial(Context* context, const v1::SkipTrialRequest* request,
                                      v1::SkipTrialResponse* response) override;
  grpc::ServerUnaryReactor* FinishAcceptance(Context* context, const v1::FinishAcceptanceRequest* request,
                                             v1::FinishAcceptanceResponse* response) override;
  grpc::ServerUnaryReactor* GetAcceptance(Context* context, const v1::GetAcceptanceRequest* request,
                                          v1::GetAcceptanceResponse* response) override;

  /// Runs `work` (grpc::ServerUnaryReactor*), which finishes the call, on the pool.
  template <typename Request, typename Work>
  grpc::ServerUnaryReactor* Do(Context* context, const char* call, const Request* request, Work work);
  Result<size_t> FindAcceptable(const std::string& name) const;
  Result<void> Measure(size_t link, const v1::MeasureTrialRequest& request, Context* context,
                       v1::MeasureTrialResponse* response, grpc::ServerUnaryReactor* reactor);

  Arm& arm_;
  const std::shared_ptr<const Security> security_;
  OpenCalls<TrialMeasurement> measurements_;
  boost::asio::thread_pool pool_{1};
};

}  // namespace taclink::server
