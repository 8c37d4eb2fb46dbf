#include "client/cpp/taclink/acceptance.h"

#include <algorithm>
#include <utility>

#include "client/cpp/connection.h"
#include "taclink/v1/acceptance.grpc.pb.h"

namespace taclink::client {
namespace {

using AcceptanceStub = v1::AcceptanceService::Stub;

// Reports are made and the disk is waited for.
constexpr std::chrono::seconds kAcceptancePatience{30};

}  // namespace

struct Acceptances::Connection {
  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<AcceptanceStub> stub;

  template <typename Request, typename Response>
  Result<v1::Acceptance> Ask(grpc::Status (AcceptanceStub::*method)(grpc::ClientContext*, const Request&,
                                                                    Response*),
                             const Request& request, std::chrono::milliseconds work = {}) const {
    auto response = client::Ask(*stub, method, request, work + Patience(kAcceptancePatience), address);
    if (!response) return response.error();
    return std::move(*response->mutable_acceptance());
  }
};

Acceptances Client::AcceptanceCalls() const {
  auto out = std::make_shared<Acceptances::Connection>();
  out->address = connection_->address;
  out->channel = connection_->channel;
  out->stub = v1::AcceptanceService::NewStub(out->channel);
  return Acceptances(std::move(out));
}

Result<v1::Acceptance> Acceptances::Start(const v1::StartAcceptanceRequest& request) {
  return connection_->Ask(&AcceptanceStub::StartAcceptance, request);
}

Result<v1::Acceptance> Acceptances::Measure(const v1::MeasureTrialRequest& request, double expected_s) {
  const double seconds = std::max(request.duration_s(), expected_s);
  // A slow link takes longer for the same time of its own clock.
  return connection_->Ask(&AcceptanceStub::MeasureTrial, request,
                          std::chrono::milliseconds(static_cast<int64_t>(2e3 * seconds)));
}

Result<v1::Acceptance> Acceptances::Skip(const v1::SkipTrialRequest& request) {
  return connection_->Ask(&AcceptanceStub::SkipTrial, request);
}

Result<v1::Acceptance> Acceptances::Finish(const v1::FinishAcceptanceRequest& request) {
  return connection_->Ask(&AcceptanceStub::FinishAcceptance, request);
}

Result<v1::Acceptance> Acceptances::Get(const v1::GetAcceptanceRequest& request) {
  return connection_->Ask(&AcceptanceStub::GetAcceptance, request);
}

}  // namespace taclink::client
