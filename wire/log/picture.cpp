#include "wire/log/picture.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <utility>

#include "foxglove/image.pb.h"
#include "wire/log/times.h"

namespace taclink::wire::log {
namespace {

using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedOutputStream;

// The pixels are copied once: they follow the other fields, which protobuf allows in any order.
std::shared_ptr<const std::string> WithData(const google::protobuf::Message& rest, int data_field,
                                            const std::vector<uint8_t>& data) {
  const uint32_t tag = WireFormatLite::MakeTag(data_field, WireFormatLite::WIRETYPE_LENGTH_DELIMITED);
  const auto size = static_cast<uint32_t>(data.size());
  auto bytes = std::make_shared<std::string>();
  bytes->reserve(rest.ByteSizeLong() + 12 + data.size());
  rest.AppendToString(bytes.get());
  uint8_t head[10];
  const uint8_t* const end =
      CodedOutputStream::WriteVarint32ToArray(size, CodedOutputStream::WriteVarint32ToArray(tag, head));
  bytes->append(reinterpret_cast<const char*>(head), static_cast<size_t>(end - head));
  bytes->append(reinterpret_cast<const char*>(data.data()), data.size());
  return bytes;
}

uint32_t BytesPerPixel(PixelFormat format) {
  return format == PixelFormat::kYuyv ? 2 : 1;
}

Result<RawImage> FromMessage(const foxglove::RawImage& message) {
  RawImage image;
  if (message.encoding() == "yuyv") {
    image.format = PixelFormat::kYuyv;
  } else if (message.encoding() == "mono8") {
    image.format = PixelFormat::kGray8;
  } else {
    return Error{ErrorCode::kUnsupported, "pictures of encoding '" + message.encoding() +
                                              "' cannot be solved; yuyv, mono8 and jpeg can"};
  }
  if (message.step() != message.width() * BytesPerPixel(image.format))
    return Error{ErrorCode::kUnsupported, "pictures with padded rows cannot be solved"};
  image.width_px = static_cast<int>(message.width());
  image.height_px = static_cast<int>(message.height());
  image.bytes.assign(message.data().begin(), message.data().end());
  image.valid = true;
  return image;
}

}  // namespace

EncodedPicture EncodePicture(const RawImage& image, const std::string& frame_id, int64_t exposure_utc_ns) {
  if (image.format == PixelFormat::kMjpeg) {
    foxglove::CompressedImage message;
    Fill(exposure_utc_ns, *message.mutable_timestamp());
    message.set_frame_id(frame_id);
    message.set_format("jpeg");
    return {message.GetDescriptor(),
            WithData(message, foxglove::CompressedImage::kDataFieldNumber, image.bytes)};
  }
  foxglove::RawImage message;
  Fill(exposure_utc_ns, *message.mutable_timestamp());
  message.set_frame_id(frame_id);
  message.set_width(static_cast<uint32_t>(image.width_px));
  message.set_height(static_cast<uint32_t>(image.height_px));
  message.set_encoding(image.format == PixelFormat::kYuyv ? "yuyv" : "mono8");
  message.set_step(message.width() * BytesPerPixel(image.format));
  return {message.GetDescriptor(), WithData(message, foxglove::RawImage::kDataFieldNumber, image.bytes)};
}

Result<RawImage> DecodePicture(std::string_view type, std::string_view bytes) {
  const auto size = static_cast<int>(bytes.size());
  foxglove::CompressedImage jpeg;
  if (type == jpeg.GetDescriptor()->full_name() && jpeg.ParseFromArray(bytes.data(), size)) {
    if (jpeg.format() != "jpeg")
      return Error{ErrorCode::kUnsupported, "pictures of format '" + jpeg.format() + "' cannot be solved"};
    RawImage image{.format = PixelFormat::kMjpeg, .bytes = {jpeg.data().begin(), jpeg.data().end()}};
    image.valid = true;
    return image;
  }
  foxglove::RawImage raw;
  if (type == raw.GetDescriptor()->full_name() && raw.ParseFromArray(bytes.data(), size))
    return FromMessage(raw);
  return Error{ErrorCode::kInvalidArgument, "no picture message of type " + std::string(type)};
}

}  // namespace taclink::wire::log
