#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/support/status.h>

#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "client/cpp/taclink/client.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::client {

// Internal to the library.

/// What went wrong with a call to the server at `address`, for people.
Error FromStatus(const grpc::Status& status, const std::string& address);

/// One unary call to the server at `address`.
template <typename Stub, typename Request, typename Response>
Result<Response> Ask(Stub& stub,
                     grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                     const Request& request, std::chrono::milliseconds timeout, const std::string& address) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + timeout);
  Response response;
  const grpc::Status status = (stub.*method)(&context, request, &response);
  if (!status.ok()) return FromStatus(status, address);
  return response;
}

template <typename Value>
Result<void> WithoutValue(const Result<Value>& result) {
  return result ? Result<void>() : result.error();
}

struct Client::Connection {
  Connection(std::string server, std::shared_ptr<grpc::Channel> over)
      : address(std::move(server)), channel(std::move(over)), stub(v1::TactileService::NewStub(channel)) {}

  /// One unary call of TactileService.
  template <typename Request, typename Response>
  Result<Response> Ask(grpc::Status (v1::TactileService::Stub::*method)(grpc::ClientContext*, const Request&,
                                                                        Response*),
                       const Request& request, std::chrono::milliseconds timeout) const {
    return client::Ask(*stub, method, request, timeout, address);
  }

  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::TactileService::Stub> stub;
};

}  // namespace taclink::client
