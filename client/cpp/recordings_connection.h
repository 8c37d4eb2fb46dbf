#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <memory>
#include <string>

#include "client/cpp/connection.h"
#include "client/cpp/taclink/recordings.h"
#include "taclink/v1/recording.grpc.pb.h"

namespace taclink::client {

// Internal to the library.

struct Recordings::Connection {
  // Stopping waits for the disk, listing reads logs that were not looked at before.
  static constexpr std::chrono::seconds kPatience{60};

  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::RecordingService::Stub> stub;

  /// One unary call of RecordingService.
  template <typename Request, typename Response>
  Result<Response> Ask(grpc::Status (v1::RecordingService::Stub::*method)(grpc::ClientContext*,
                                                                          const Request&, Response*),
                       const Request& request) const {
    return client::Ask(*stub, method, request, Patience(kPatience), address);
  }
};

}  // namespace taclink::client
