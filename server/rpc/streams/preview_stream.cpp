#include "server/rpc/streams/preview_stream.h"

#include <utility>

#include "server/arm/link_names.h"
#include "server/rpc/requests/request_check.h"
#include "wire/convert.h"

namespace taclink::server {
namespace {

constexpr double kDefaultRateHz = 5;

}  // namespace

Result<PreviewOptions> ParsePreviewRequest(const grpc::ByteBuffer& bytes,
                                           const std::vector<std::string>& link_names) {
  const auto request = ParseRequest<v1::StreamPreviewRequest>(bytes);
  if (!request) return request.error();
  const double rate_hz = request->max_rate_hz();
  const auto link = FindLink(link_names, request->link());
  if (!link) return link.error();
  return PreviewOptions{.link = *link, .max_rate_hz = rate_hz == 0 ? kDefaultRateHz : rate_hz};
}

PreviewStream::PreviewStream(const PreviewOptions& options, std::string link, StreamRegistry& registry,
                             std::shared_ptr<boost::asio::thread_pool> makers)
    : PumpedStream(registry, std::move(makers)), options_(options), link_(std::move(link)) {}

void PreviewStream::Begin(Hub& hub) {
  std::vector<bool> links(hub.links(), false);
  links[options_.link] = true;
  subscription_ = hub.Subscribe({.links = std::move(links),
                                 .delivery = Delivery::kLatest,
                                 .max_rate_hz = options_.max_rate_hz,
                                 .party_bytes = party_bytes(),
                                 .pictures = true},
                                Notifier());
  Open();
}

std::optional<grpc::ByteBuffer> PreviewStream::Next() {
  PicturesPtr pictures;
  while (const auto publication = subscription_->Take(nullptr, &pictures)) {
    if (!pictures) continue;  // a mere report
    const LinkState& state = publication->state();
    v1::StreamPreviewResponse message;
    message.set_link(link_);
    message.set_sequence(state.sequence);
    message.set_exposure_utc_ns(state.times.exposure_utc_ns);
    message.set_status(wire::ToWire(state.status));
    for (size_t camera = 0; camera < kCameraCount; ++camera) Fill(*pictures, camera, *message.add_pictures());
    const grpc::Slice slice(message.SerializeAsString());
    return grpc::ByteBuffer(&slice, 1);
  }
  return std::nullopt;
}

void PreviewStream::Fill(const FramePictures& pictures, size_t camera, v1::PreviewPicture& out) {
  maker_.Fill(pictures.raw[camera], kBothCameras[camera], out);
  if (!pictures.raw[camera].valid) return;
  const auto& markers = pictures.labels.cameras[camera];
  for (size_t marker = 0; marker < markers.size(); ++marker) {
    if (!markers[marker].seen) continue;
    out.add_markers(static_cast<uint32_t>(marker));
    out.add_centers_px(static_cast<float>(markers[marker].center_px.x()));
    out.add_centers_px(static_cast<float>(markers[marker].center_px.y()));
    out.add_center_sigmas_px(static_cast<float>(markers[marker].sigma_px()));
  }
}

std::optional<grpc::ByteBuffer> PreviewStream::Last(const std::string&) {
  return std::nullopt;
}

}  // namespace taclink::server
