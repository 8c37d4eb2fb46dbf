#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "server/gateway/grpc_web.h"

namespace grpc {
class Channel;
}

namespace taclink::server {

struct GrpcCallRequest {
  std::string method;                 ///< "/package.Service/Method"
  std::vector<std::string> messages;  ///< serialised; a unary method takes one
  std::optional<std::chrono::nanoseconds> timeout;
  std::string peer, name;  ///< who calls (see server/security/forwarded.h); name empty: not known
  char role = 0;           ///< likewise
};

/// One gRPC call by the method's name, bytes through. At most one answer waits here: the next one is read
/// when this one was taken, so that a slow taker slows the call and nothing else. Cancels the call when
/// destroyed.
class GrpcCall {
 public:
  ~GrpcCall();
  GrpcCall(const GrpcCall&) = delete;
  GrpcCall& operator=(const GrpcCall&) = delete;

  /// The next answer, or, at last, how the call ended; none: neither yet.
  std::optional<std::variant<std::string, WebStatus>> Take();

 private:
  friend class GrpcCalls;
  class Reactor;
  explicit GrpcCall(std::shared_ptr<Reactor> reactor);

  const std::shared_ptr<Reactor> reactor_;
};

/// The calls over one channel. Outlives what gRPC still has to do for them: a channel whose last owner is one
/// of gRPC's own callbacks would end the thread it runs on.
class GrpcCalls {
 public:
  explicit GrpcCalls(std::shared_ptr<grpc::Channel> channel) : channel_(std::move(channel)) {}
  ~GrpcCalls() { WaitUntilDone(); }
  GrpcCalls(const GrpcCalls&) = delete;
  GrpcCalls& operator=(const GrpcCalls&) = delete;

  /// `notify` is called, by any thread, when the call's Take may have something; also after the call was
  /// destroyed.
  std::unique_ptr<GrpcCall> Start(GrpcCallRequest request, std::function<void()> notify);
  /// Once every GrpcCall was destroyed.
  void WaitUntilDone();

 private:
  void Forget(GrpcCall::Reactor* reactor);

  const std::shared_ptr<grpc::Channel> channel_;
  std::mutex mutex_;
  std::condition_variable none_left_;
  size_t under_way_ = 0;  // guarded by mutex_
};

}  // namespace taclink::server
