#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

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

  /// One call; `call` gets the context.
  template <typename F>
  Result<void> Ask(const F& call) const {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + Patience(kPatience));
    const grpc::Status status = call(context);
    if (!status.ok()) return FromStatus(status, address);
    return {};
  }
};

}  // namespace taclink::client
