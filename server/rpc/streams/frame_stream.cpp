#include "server/rpc/streams/frame_stream.h"

#include <algorithm>
#include <array>
#include <utility>

#include "taclink/v1/tactile.pb.h"
#include "wire/frame_codec.h"

namespace taclink::server {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kStatusInterval{1};
constexpr int64_t kLateNs = 200'000'000;

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

FrameStream::FrameStream(FrameStreamOptions options, std::vector<std::string> link_names, const Clock& clock,
                         StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders)
    : PumpedStream(registry, std::move(senders)),
      options_(std::move(options)),
      link_names_(std::move(link_names)),
      clock_(clock) {}

void FrameStream::Begin(Hub& hub) {
  SubscriberOptions options = options_.subscriber;
  options.party_bytes = party_bytes();
  begun_ns_ = clock_.MonotonicNs();  // the first frames may be older
  subscription_ = hub.Subscribe(std::move(options), Notifier());
  Open();
}

std::optional<grpc::ByteBuffer> FrameStream::Next() {
  // Asked again once the last message was sent.
  if (const int64_t published_ns = std::exchange(under_way_ns_, 0); published_ns != 0)
    lateness_ns_ = std::max(lateness_ns_, clock_.MonotonicNs() - published_ns);
  if (IsStatusDue()) return Status("");
  bool unchanged = false;
  const auto publication = subscription_->Take(&unchanged);
  if (!publication) return std::nullopt;
  under_way_ns_ = std::max(publication->state().times.published_ns, begun_ns_);
  return Frame(*publication, unchanged);
}

bool FrameStream::IsStatusDue() const {
  if (!status_sent_) return true;
  const bool news = subscription_->dropped() != dropped_told_ || lateness_ns_ > kLateNs || was_late_;
  return news && steady_clock::now() - status_time_ >= kStatusInterval;
}

std::optional<grpc::ByteBuffer> FrameStream::Last(const std::string& reason) {
  return Status(reason);
}

grpc::ByteBuffer FrameStream::Status(const std::string& end_reason) {
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
    entry.set_frames_dropped_for_bytes(counts[link].dropped_for_bytes);
    entry.set_frames_unchanged(counts[link].unchanged);
  }
  status.set_queue_capacity(static_cast<uint32_t>(subscription_->capacity()));
  status.set_queue_capacity_bytes(options_.subscriber.queue_bytes);
  status.set_lateness_s(static_cast<double>(lateness_ns_) * 1e-9);
  status.set_end_reason(end_reason);
  was_late_ = std::exchange(lateness_ns_, 0) > kLateNs;
  status_sent_ = true;
  status_time_ = steady_clock::now();
  const grpc::Slice slice(response.SerializeAsString());
  return {&slice, 1};
}

// A frame that tells nothing new is small, and marked by what stands after the shared bytes.
grpc::ByteBuffer FrameStream::Frame(const Publication& publication, bool unchanged) const {
  auto frame = publication.Encoded(unchanged ? Detail::kContacts : options_.detail);
  const std::string mark = unchanged ? wire::UnchangedMark() : "";
  std::array<grpc::Slice, 3> slices = {
      grpc::Slice(wire::FrameResponsePrefix(frame->size() + mark.size())), {}, grpc::Slice(mark)};
  slices[1] = SharedSlice(std::move(frame));
  return {slices.data(), unchanged ? 3U : 2U};
}

}  // namespace taclink::server
