#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/support/status.h>

#include <memory>
#include <string>

#include "client/taclink/client.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::client {

// Internal to the library.

struct Client::Connection {
  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::TactileService::Stub> stub;
};

/// What went wrong with a call to the server at `address`, for people.
Error FromStatus(const grpc::Status& status, const std::string& address);

}  // namespace taclink::client
