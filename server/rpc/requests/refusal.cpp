#include "server/rpc/requests/refusal.h"

#include <spdlog/spdlog.h>

#include "server/rpc/requests/status.h"
#include "server/rpc/requests/who.h"

namespace taclink::server {
namespace {

class RefusedStream final : public grpc::ServerWriteReactor<grpc::ByteBuffer> {
 public:
  explicit RefusedStream(const Error& error) { Finish(ToGrpc(error)); }

 private:
  void OnDone() override { delete this; }
};

}  // namespace

grpc::ServerUnaryReactor* RefuseCall(grpc::CallbackServerContext& context, const char* method,
                                     const Error& error) {
  SPDLOG_INFO("{}: {} refused: {}", PeerOf(context), method, error.message);
  grpc::ServerUnaryReactor* const reactor = context.DefaultReactor();
  reactor->Finish(ToGrpc(error));
  return reactor;
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* RefuseStream(const grpc::CallbackServerContext& context,
                                                         const char* method, const Error& error) {
  SPDLOG_INFO("{}: {} refused: {}", PeerOf(context), method, error.message);
  return new RefusedStream(error);  // deletes itself when gRPC is done with it
}

}  // namespace taclink::server
