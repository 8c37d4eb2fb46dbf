#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "server/rpc/requests/status.h"
#include "server/security/shares.h"

namespace taclink::server {

/// A client-streaming call that the server can end.
class UpdateCall {
 public:
  virtual ~UpdateCall() = default;
  virtual void End(const grpc::Status& status) = 0;
};

/// The client-streaming calls of a server; bounds their number, of all and of each party. Holds each until
/// gRPC is done with it.
class UpdateRegistry {
 public:
  explicit UpdateRegistry(const ShareLimits& limits)
      : shares_(limits, {.things = "calls that feed the server", .all_setting = "", .party_setting = ""}) {}

  /// Errors: kResourceExhausted, kUnavailable (closed).
  Result<void> Add(std::shared_ptr<UpdateCall> call, const Party& party) {
    const std::lock_guard lock(mutex_);
    if (closed_) return Error{ErrorCode::kUnavailable, "server is shutting down"};
    if (const auto taken = shares_.Take(party); !taken) return taken;
    calls_.emplace(std::move(call), party);
    return {};
  }
  /// The call is about to end: it counts no more, or a client that begins the next one at once would be
  /// refused.
  void Release(const std::shared_ptr<UpdateCall>& call) {
    const std::lock_guard lock(mutex_);
    const auto at = calls_.find(call);
    if (at == calls_.end()) return;  // was refused
    if (const auto party = std::exchange(at->second, std::nullopt)) shares_.Give(*party);
  }
  /// gRPC is done with it.
  void Remove(const std::shared_ptr<UpdateCall>& call) {
    Release(call);
    const std::lock_guard lock(mutex_);
    calls_.erase(call);
  }
  /// Ends all and takes no more.
  void Close(const std::string& reason) {
    Calls calls;
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      calls = calls_;
    }
    for (const auto& [call, party] : calls) call->End({grpc::StatusCode::UNAVAILABLE, reason});
  }
  size_t calls() const {
    const std::lock_guard lock(mutex_);
    return calls_.size();
  }

 private:
  using Calls = std::map<std::shared_ptr<UpdateCall>, std::optional<Party>>;  // none: counts no more

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  Shares shares_;
  Calls calls_;
  bool closed_ = false;
};

/// Takes a client's messages one by one; the next is read when one was taken, so that a fast client waits.
/// The messages arrive as bytes, because gRPC reports a message that it cannot parse like the end of the
/// client's messages.
class UpdateStream final : public grpc::ServerReadReactor<grpc::ByteBuffer>,
                           public UpdateCall,
                           public std::enable_shared_from_this<UpdateStream> {
 public:
  /// `take`: each message; an error ends the call with it. `respond`: the response at the client's end,
  /// written to `response`, which gRPC sends.
  UpdateStream(UpdateRegistry& registry, std::function<Result<void>(const grpc::ByteBuffer&)> take,
               std::function<grpc::ByteBuffer()> respond, grpc::ByteBuffer& response)
      : registry_(registry), take_(std::move(take)), respond_(std::move(respond)), response_(response) {}

  /// Only once the registry was asked; `accepted`: what it said.
  void Begin(const Result<void>& accepted) {
    if (!accepted) {
      self_ = this->shared_from_this();
      return End(ToGrpc(accepted.error()));
    }
    this->StartRead(&message_);
  }

  void End(const grpc::Status& status) override {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(finished_, true)) return;
    }
    registry_.Release(this->shared_from_this());
    this->Finish(status);
  }

 private:
  void OnReadDone(bool ok) override {
    if (!ok) {  // the client has sent all, or is gone
      response_ = respond_();
      return End(grpc::Status::OK);
    }
    if (const auto taken = take_(message_); !taken) return End(ToGrpc(taken.error()));
    const std::lock_guard lock(mutex_);
    if (!finished_) this->StartRead(&message_);  // not after Finish
  }
  void OnCancel() override { End(grpc::Status::CANCELLED); }
  void OnDone() override {
    const auto last = this->shared_from_this();
    self_.reset();
    registry_.Remove(last);
  }

  // Constant after construction.
  UpdateRegistry& registry_;
  const std::function<Result<void>(const grpc::ByteBuffer&)> take_;
  const std::function<grpc::ByteBuffer()> respond_;

  grpc::ByteBuffer& response_;          // gRPC's, until OnDone
  std::shared_ptr<UpdateStream> self_;  // of a refused call, until gRPC is done
  grpc::ByteBuffer message_;            // being read, or taken
  std::mutex mutex_;
  // Guarded by mutex_.
  bool finished_ = false;
};

}  // namespace taclink::server
