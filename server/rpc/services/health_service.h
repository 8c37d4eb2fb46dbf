#pragma once

#include <grpcpp/impl/codegen/service_type.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <boost/asio/thread_pool.hpp>
#include <memory>
#include <set>
#include <string>

#include "server/rpc/streams/stream_registry.h"
#include "server/security/security.h"

namespace taclink::server {

/// grpc.health.v1.Health, as any gRPC tool asks it. In place of gRPC's own, whose Watch streams nobody
/// counts: here they take places of the registry's shares as all other streams. Its two messages have one
/// field each and are, byte for byte, wrappers of google.protobuf; a copy of health.proto could meet that of
/// a program which links the client library.
class HealthService final : public grpc::Service {
 public:
  /// `services`: full names of those that serve, beside the whole server, whose name is "". `registry`: of
  /// all streams of the server.
  HealthService(std::set<std::string> services, StreamRegistry& registry,
                std::shared_ptr<boost::asio::thread_pool> senders, std::shared_ptr<const Security> security);

  /// From now on nothing serves. Watches hear it when the registry ends them.
  void Stop() { serving_ = false; }

 private:
  grpc::ServerUnaryReactor* Check(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                  grpc::ByteBuffer* response);
  grpc::ServerWriteReactor<grpc::ByteBuffer>* Watch(grpc::CallbackServerContext* context,
                                                    const grpc::ByteBuffer* request);
  bool Knows(const std::string& service) const { return service.empty() || services_.contains(service); }

  // Constant after construction.
  const std::set<std::string> services_;
  StreamRegistry& registry_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  const std::shared_ptr<const Security> security_;

  std::atomic<bool> serving_ = true;
};

}  // namespace taclink::server
