#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/support/status.h>

#include <memory>
#include <string>
#include <utility>

#include "client/cpp/taclink/client.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::client {

// Internal to the library.

struct Client::Connection {
  Connection(std::string server, std::shared_ptr<grpc::Channel> over)
      : address(std::move(server)), channel(std::move(over)), stub(v1::TactileService::NewStub(channel)) {}

  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::TactileService::Stub> stub;
};

/// What went wrong with a call to the server at `address`, for people.
Error FromStatus(const grpc::Status& status, const std::string& address);

}  // namespace taclink::client
