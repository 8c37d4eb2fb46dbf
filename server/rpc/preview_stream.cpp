#include "server/rpc/preview_stream.h"

#include <grpcpp/impl/codegen/proto_utils.h>

#include <cmath>
#include <utility>

#include "server/link_names.h"
#include "wire/convert.h"

namespace taclink::server {
namespace {

constexpr double kDefaultRateHz = 5, kMaxRateHz = 30;

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

}  // namespace

Result<PreviewOptions> ParsePreviewRequest(const grpc::ByteBuffer& bytes,
                                           const std::vector<std::string>& link_names) {
  v1::StreamPreviewRequest request;
  grpc::ByteBuffer copy(bytes);  // parsing empties it
  if (!grpc::SerializationTraits<v1::StreamPreviewRequest>::Deserialize(&copy, &request).ok())
    return Invalid("the request is no StreamPreviewRequest message");
  const double rate_hz = request.max_rate_hz();
  if (!std::isfinite(rate_hz) || rate_hz < 0 || rate_hz > kMaxRateHz)
    return Invalid("max_rate_hz must be 0 to 30 Hz");
  const auto link = FindLink(link_names, request.link());
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
