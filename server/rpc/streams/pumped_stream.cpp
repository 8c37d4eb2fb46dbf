#include "server/rpc/streams/pumped_stream.h"

#include <boost/asio/post.hpp>
#include <utility>

#include "server/process/shared_socket.h"
#include "server/rpc/streams/stream_registry.h"

namespace taclink::server {

PumpedStream::PumpedStream(StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders,
                           Urgency urgency)
    : registry_(registry), senders_(std::move(senders)), urgency_(urgency), retry_(*senders_) {}

void PumpedStream::Open() {
  {
    const std::lock_guard lock(mutex_);
    open_ = true;
  }
  Pump();
}

std::function<void()> PumpedStream::Notifier() {
  return [weak = weak_from_this(), senders = senders_] {
    boost::asio::post(*senders, [weak] {
      if (const auto stream = weak.lock()) stream->Pump();
    });
  };
}

void PumpedStream::End(const std::string& reason) {
  {
    const std::lock_guard lock(mutex_);
    end_reason_ = reason;
  }
  Pump();
}

void PumpedStream::OnWriteDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    cancelled_ = cancelled_ || !ok;
  }
  Pump();
}

void PumpedStream::OnCancel() {
  {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
  }
  Pump();
}

void PumpedStream::OnDone() {
  registry_.Remove(shared_from_this());
}

void PumpedStream::Pump() {
  Step step;
  grpc::Status status;
  {
    const std::lock_guard lock(mutex_);
    step = Decide();
    // Also where the server gave up on a client that does not read: it may still get to see the reason.
    status = end_reason_.empty() ? end_.value_or(grpc::Status::CANCELLED)
                                 : grpc::Status(grpc::StatusCode::UNAVAILABLE, end_reason_);
  }
  // Outside the lock: writing_ or finished_ now keep every other thread from coming here.
  switch (step) {
    case Step::kNothing:
      break;
    case Step::kWrite:
      // Done once the system has taken its bytes, and not once gRPC has: else another message would wait
      // there, and grow old, on a slow link.
      StartWrite(&message_, grpc::WriteOptions().set_write_through());
      break;
    case Step::kFinish:
      // Not together with the last message: a client within the process (gRPC 1.51) that is not reading at
      // that moment would get the message and never the end.
      Finish(status);
      break;
  }
}

PumpedStream::Step PumpedStream::Decide() {
  if (writing_ || finished_ || !open_) return Step::kNothing;
  if (cancelled_) {
    finished_ = true;
    return Step::kFinish;
  }
  const bool ends = !end_reason_.empty();
  if (!ends && !MaySend()) return Step::kNothing;
  std::optional<grpc::ByteBuffer> message;
  if (!ends) message = Next();
  if (ends && !std::exchange(last_made_, true)) message = Last(end_reason_);
  if (!message) {
    finished_ = ends || end_;
    return finished_ ? Step::kFinish : Step::kNothing;
  }
  message_ = std::move(*message);
  writing_ = true;
  return Step::kWrite;
}

bool PumpedStream::MaySend() {
  if (urgency_ == Urgency::kUrgent || !socket_) return true;
  const std::chrono::milliseconds delay = socket_->SendDelay();
  if (delay.count() == 0) return true;
  if (std::exchange(delayed_, true)) return false;
  retry_.expires_after(delay);
  retry_.async_wait([weak = weak_from_this()](const boost::system::error_code&) {
    const auto stream = weak.lock();
    if (!stream) return;
    {
      const std::lock_guard lock(stream->mutex_);
      stream->delayed_ = false;
    }
    stream->Pump();
  });
  return false;
}

}  // namespace taclink::server
