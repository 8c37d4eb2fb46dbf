#include "server/rpc/frame_stream.h"

#include <array>
#include <boost/asio/post.hpp>
#include <utility>

#include "taclink/v1/tactile.pb.h"
#include "wire/frame_codec.h"

namespace taclink::server {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kStatusInterval{1};

// A slice that keeps the shared bytes alive instead of copying them.
grpc::Slice SharedSlice(std::shared_ptr<const std::string> bytes) {
  using Holder = std::shared_ptr<const std::string>;
  auto holder = std::make_unique<Holder>(std::move(bytes));
  const std::string& text = **holder;
  // gRPC's interface is not const, but it only reads.
  return {const_cast<char*>(text.data()), text.size(), [](void* held) { delete static_cast<Holder*>(held); },
          holder.release()};
}

}  // namespace

FrameStream::FrameStream(FrameStreamOptions options, std::vector<std::string> link_names,
                         StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders)
    : options_(std::move(options)),
      link_names_(std::move(link_names)),
      registry_(registry),
      senders_(std::move(senders)) {}

void FrameStream::Begin(Hub& hub) {
  auto notify = [weak = weak_from_this(), senders = senders_] {
    boost::asio::post(*senders, [weak] {
      if (const auto stream = weak.lock()) stream->Pump();
    });
  };
  {
    const std::lock_guard lock(mutex_);
    subscription_ = hub.Subscribe(options_.subscriber, std::move(notify));
  }
  Pump();
}

void FrameStream::End(const std::string& reason) {
  {
    const std::lock_guard lock(mutex_);
    end_reason_ = reason;
  }
  Pump();
}

void FrameStream::OnWriteDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    cancelled_ = cancelled_ || !ok;
  }
  Pump();
}

void FrameStream::OnCancel() {
  {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
  }
  Pump();
}

void FrameStream::OnDone() {
  registry_.Remove(shared_from_this());
}

void FrameStream::Pump() {
  Step step;
  {
    const std::lock_guard lock(mutex_);
    step = Decide();
  }
  // Outside the lock: writing_ or finished_ now keep every other thread from coming here.
  switch (step) {
    case Step::kNothing:
      break;
    case Step::kWrite:
      StartWrite(&message_);
      break;
    case Step::kWriteLast:
      StartWriteAndFinish(&message_, grpc::WriteOptions(),
                          grpc::Status(grpc::StatusCode::UNAVAILABLE, end_reason_));
      break;
    case Step::kFinishCancelled:
      // Also where the server gave up on a client that does not read: it may still get to see the reason.
      Finish(end_reason_.empty() ? grpc::Status::CANCELLED
                                 : grpc::Status(grpc::StatusCode::UNAVAILABLE, end_reason_));
      break;
  }
}

FrameStream::Step FrameStream::Decide() {
  if (writing_ || finished_ || !subscription_) return Step::kNothing;
  if (cancelled_) {
    finished_ = true;
    return Step::kFinishCancelled;
  }
  if (!end_reason_.empty()) {
    finished_ = true;
    MakeStatus();
    return Step::kWriteLast;
  }
  const bool news = subscription_->dropped() != dropped_told_;
  if (!status_sent_ || (news && steady_clock::now() - status_time_ >= kStatusInterval)) {
    MakeStatus();
  } else if (const auto publication = subscription_->Take()) {
    MakeFrame(*publication);
  } else {
    return Step::kNothing;
  }
  writing_ = true;
  return Step::kWrite;
}

void FrameStream::MakeStatus() {
  v1::StreamFramesResponse response;
  v1::StreamStatus& status = *response.mutable_status();
  dropped_told_ = subscription_->dropped();
  const auto counts = subscription_->Counts();
  for (size_t link = 0; link < counts.size(); ++link) {
    const auto& wanted = options_.subscriber.links;
    if (!wanted.empty() && !wanted[link]) continue;
    auto& entry = *status.add_links();
    entry.set_link(link_names_[link]);
    entry.set_frames_sent(counts[link].taken);
    entry.set_frames_dropped(counts[link].dropped);
  }
  status.set_queue_capacity(static_cast<uint32_t>(subscription_->capacity()));
  status.set_end_reason(end_reason_);
  status_sent_ = true;
  status_time_ = steady_clock::now();
  grpc::Slice slice(response.SerializeAsString());
  message_ = grpc::ByteBuffer(&slice, 1);
}

void FrameStream::MakeFrame(const Publication& publication) {
  auto frame = publication.Encoded(options_.detail);
  std::array<grpc::Slice, 2> slices = {grpc::Slice(wire::FrameResponsePrefix(frame->size())), {}};
  slices[1] = SharedSlice(std::move(frame));
  message_ = grpc::ByteBuffer(slices.data(), slices.size());
}

StreamRegistry::Added StreamRegistry::Add(std::shared_ptr<FrameStream> stream) {
  const std::lock_guard lock(mutex_);
  if (closed_) return Added::kClosed;
  if (streams_.size() >= max_streams_) return Added::kFull;
  streams_.insert(std::move(stream));
  return Added::kYes;
}

void StreamRegistry::Remove(const std::shared_ptr<FrameStream>& stream) {
  const std::lock_guard lock(mutex_);
  streams_.erase(stream);
}

void StreamRegistry::Close(const std::string& reason) {
  std::set<std::shared_ptr<FrameStream>> streams;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    streams = streams_;
  }
  for (const auto& stream : streams) stream->End(reason);
}

size_t StreamRegistry::streams() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

}  // namespace taclink::server
