#include "server/gateway/grpc_call.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/client_callback.h>

#include "server/security/forwarded.h"

namespace taclink::server {
namespace {

std::string ToText(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  std::string text;
  if (!buffer.Dump(&slices).ok()) return text;
  text.reserve(buffer.Length());
  for (const auto& slice : slices) text.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  return text;
}

}  // namespace

/// Held by gRPC until OnDone, and by the GrpcCall.
class GrpcCall::Reactor final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  Reactor(const std::shared_ptr<grpc::Channel>& channel, GrpcCallRequest request,
          std::function<void()> notify)
      : stub_(channel), request_(std::move(request)), notify_(std::move(notify)) {}

  void Start(std::shared_ptr<Reactor> self) {
    self_ = std::move(self);
    if (request_.timeout)
      context_.set_deadline(std::chrono::system_clock::now() +
                            std::chrono::duration_cast<std::chrono::microseconds>(*request_.timeout));
    context_.AddMetadata(kForwardedPeer, request_.peer);
    if (!request_.name.empty()) context_.AddMetadata(kForwardedName, request_.name);
    context_.AddMetadata(kForwardedRole, std::string(1, request_.role));
    stub_.PrepareBidiStreamingCall(&context_, request_.method, {}, this);
    AddHold();  // reads are started from outside gRPC's own callbacks
    StartRead(&response_);
    WriteNext();
    StartCall();
  }

  std::optional<std::variant<std::string, WebStatus>> Take() {
    std::string text;
    {
      const std::lock_guard lock(mutex_);
      if (!waiting_) {
        if (!status_) return std::nullopt;
        return *status_;
      }
      waiting_ = false;
      text = ToText(response_);
    }
    StartRead(&response_);
    return text;
  }

  // No Take will follow.
  void Abandon() {
    context_.TryCancel();
    const bool unheld = [this] {
      const std::lock_guard lock(mutex_);
      abandoned_ = true;
      return std::exchange(waiting_, false);
    }();
    if (unheld) RemoveHold();
  }

 private:
  void WriteNext() {
    if (written_ == request_.messages.size()) return StartWritesDone();
    const grpc::Slice slice(request_.messages[written_++]);
    message_ = grpc::ByteBuffer(&slice, 1);
    StartWrite(&message_);
  }

  void OnWriteDone(bool ok) override {
    if (ok) WriteNext();
  }

  void OnReadDone(bool ok) override {
    const bool taker = [&] {
      const std::lock_guard lock(mutex_);
      waiting_ = ok && !abandoned_;
      return waiting_;
    }();
    if (taker) {
      notify_();
    } else {
      RemoveHold();
    }
  }

  void OnDone(const grpc::Status& status) override {
    std::shared_ptr<Reactor> self;
    {
      const std::lock_guard lock(mutex_);
      status_ = WebStatus{static_cast<int>(status.error_code()), status.error_message()};
      self = std::move(self_);
    }
    notify_();
  }

  // Constant after construction.
  grpc::GenericStub stub_;
  const GrpcCallRequest request_;
  const std::function<void()> notify_;

  // Used by one of gRPC's callbacks at a time.
  grpc::ClientContext context_;
  size_t written_ = 0;
  grpc::ByteBuffer message_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::shared_ptr<Reactor> self_;  // until gRPC is done
  grpc::ByteBuffer response_;      // gRPC's while it reads, else ours
  bool waiting_ = false;           // response_ is to be taken; no read is under way
  bool abandoned_ = false;
  std::optional<WebStatus> status_;
};

GrpcCall::GrpcCall(std::shared_ptr<Reactor> reactor) : reactor_(std::move(reactor)) {
  reactor_->Start(reactor_);
}

GrpcCall::~GrpcCall() {
  reactor_->Abandon();
}

std::optional<std::variant<std::string, WebStatus>> GrpcCall::Take() {
  return reactor_->Take();
}

std::unique_ptr<GrpcCall> GrpcCalls::Start(GrpcCallRequest request, std::function<void()> notify) {
  auto made = std::make_unique<GrpcCall::Reactor>(channel_, std::move(request), std::move(notify));
  {
    const std::lock_guard lock(mutex_);
    ++under_way_;
  }
  std::shared_ptr<GrpcCall::Reactor> reactor(made.release(),
                                             [this](GrpcCall::Reactor* last) { Forget(last); });
  return std::unique_ptr<GrpcCall>(new GrpcCall(std::move(reactor)));
}

void GrpcCalls::Forget(GrpcCall::Reactor* reactor) {
  delete reactor;
  const std::lock_guard lock(mutex_);
  --under_way_;
  none_left_.notify_all();  // under the lock: who waits may destroy this
}

void GrpcCalls::WaitUntilDone() {
  std::unique_lock lock(mutex_);
  none_left_.wait(lock, [this] { return under_way_ == 0; });
}

}  // namespace taclink::server
