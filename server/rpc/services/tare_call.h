#pragma once

#include <grpcpp/support/server_callback.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "sensing/core/baseline.h"
#include "sensing/core/result.h"
#include "taclink/v1/tare.pb.h"

namespace taclink::server {

/// One client's Tare call: gathers what the links answer. Held by the links' observers.
class TareCall {
 public:
  /// `links`: names, in the order of the response. The reactor is finished once all have answered, or at End.
  TareCall(const std::vector<std::string>& links, v1::TareResponse* response,
           grpc::ServerUnaryReactor* reactor);

  /// Any thread; once for each place.
  void Answer(size_t place, const Result<TareSummary>& answer);
  /// The server does not wait for the rest.
  void End(const Error& why);

 private:
  std::mutex mutex_;
  // Guarded by mutex_.
  v1::TareResponse* response_;  // until the reactor is finished
  grpc::ServerUnaryReactor* reactor_;
  size_t open_;
};

}  // namespace taclink::server
