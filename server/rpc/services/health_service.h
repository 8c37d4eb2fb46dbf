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
  /// `services`: full names of those that serve, beside the whole server, whose name is "". Watches need no
  /// token, and so have places of their own: they take none from the streams of those who have one.
  HealthService(std::set<std::string> services, std::shared_ptr<boost::asio::thread_pool> senders,
                std::shared_ptr<const Security> security);

  /// From now on nothing serves; watches are told and end.
  void Stop(const std::string& reason) {
    serving_ = false;
    registry_.Close(reason);
  }
  size_t watches() const { return registry_.streams(); }

 private:
  grpc::ServerUnaryReactor* Check(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                  grpc::ByteBuffer* response);
  grpc::ServerWriteReactor<grpc::ByteBuffer>* Watch(grpc::CallbackServerContext* context,
                                                    const grpc::ByteBuffer* request);
  bool Knows(const std::string& service) const { return service.empty() || services_.contains(service); }

  // Constant after construction.
  const std::set<std::string> services_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  const std::shared_ptr<const Security> security_;

  StreamRegistry registry_;
  std::atomic<bool> serving_ = true;
};

}  // namespace taclink::server
