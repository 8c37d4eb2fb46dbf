#include "server/rpc/services/health_service.h"

#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/impl/codegen/rpc_service_method.h>
#include <grpcpp/impl/codegen/server_callback_handlers.h>

#include <optional>
#include <utility>

#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"
#include "server/rpc/requests/status.h"
#include "server/rpc/requests/who.h"

namespace taclink::server {
namespace {

using HealthRequest = google::protobuf::StringValue;   // HealthCheckRequest: string service = 1
using HealthResponse = google::protobuf::UInt32Value;  // HealthCheckResponse: ServingStatus status = 1

constexpr size_t kMostWatches = 64, kMostWatchesPerParty = 8;

// HealthCheckResponse.ServingStatus
enum class ServingStatus : uint32_t { kServing = 1, kNotServing = 2, kServiceUnknown = 3 };

grpc::ByteBuffer HealthBytes(ServingStatus status) {
  HealthResponse response;
  response.set_value(static_cast<uint32_t>(status));
  const grpc::Slice slice(response.SerializeAsString());
  return {&slice, 1};
}

/// One client's Watch call. What serves does so until the server ends its streams.
class HealthStream final : public PumpedStream {
 public:
  HealthStream(ServingStatus status, StreamRegistry& registry,
               std::shared_ptr<boost::asio::thread_pool> senders)
      : PumpedStream(registry, std::move(senders)), status_(status) {}

  using PumpedStream::Open;

 private:
  std::optional<grpc::ByteBuffer> Next() override {
    if (std::exchange(sent_, true)) return std::nullopt;
    return HealthBytes(status_);
  }
  std::optional<grpc::ByteBuffer> Last(const std::string&) override {
    return HealthBytes(ServingStatus::kNotServing);
  }

  const ServingStatus status_;
  bool sent_ = false;  // used by one thread at a time
};

}  // namespace

HealthService::HealthService(std::set<std::string> services,
                             std::shared_ptr<boost::asio::thread_pool> senders,
                             std::shared_ptr<const Security> security)
    : services_(std::move(services)),
      senders_(std::move(senders)),
      security_(std::move(security)),
      registry_({.streams = {.all = kMostWatches, .per_party = kMostWatchesPerParty}},
                {.things = "watches of health", .all_setting = "", .party_setting = ""}) {
  using grpc::internal::RpcMethod;
  using grpc::internal::RpcServiceMethod;
  // As generated code does it.
  AddMethod(new RpcServiceMethod("/grpc.health.v1.Health/Check", RpcMethod::NORMAL_RPC, nullptr));
  AddMethod(new RpcServiceMethod("/grpc.health.v1.Health/Watch", RpcMethod::SERVER_STREAMING, nullptr));
  MarkMethodRawCallback(
      0, new grpc::internal::CallbackUnaryHandler<grpc::ByteBuffer, grpc::ByteBuffer>(
             [this](grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                    grpc::ByteBuffer* response) { return Check(context, request, response); }));
  MarkMethodRawCallback(
      1, new grpc::internal::CallbackServerStreamingHandler<grpc::ByteBuffer, grpc::ByteBuffer>(
             [this](grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) {
               return Watch(context, request);
             }));
}

grpc::ServerUnaryReactor* HealthService::Check(grpc::CallbackServerContext* context,
                                               const grpc::ByteBuffer* bytes, grpc::ByteBuffer* response) {
  auto* reactor = context->DefaultReactor();
  const auto request = ParseRequest<HealthRequest>(*bytes);
  if (!request) {
    reactor->Finish(ToGrpc(request.error()));
  } else if (!Knows(request->value())) {
    reactor->Finish({grpc::StatusCode::NOT_FOUND, "the server has no service '" + request->value() + "'"});
  } else {
    *response = HealthBytes(serving_ ? ServingStatus::kServing : ServingStatus::kNotServing);
    reactor->Finish(grpc::Status::OK);
  }
  return reactor;
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* HealthService::Watch(grpc::CallbackServerContext* context,
                                                                 const grpc::ByteBuffer* bytes) {
  constexpr const char* kCall = "Health/Watch";
  const auto request = ParseRequest<HealthRequest>(*bytes);
  if (!request) return RefuseStream(*context, kCall, request.error());
  const auto status = Knows(request->value()) ? ServingStatus::kServing : ServingStatus::kServiceUnknown;
  auto stream = std::make_shared<HealthStream>(status, registry_, senders_);
  if (const auto admitted = registry_.Admit(stream, PartyOf(*context, *security_), context->peer());
      !admitted)
    return RefuseStream(*context, kCall, admitted.error());
  stream->Open();
  return stream.get();  // the registry holds it until gRPC is done
}

}  // namespace taclink::server
