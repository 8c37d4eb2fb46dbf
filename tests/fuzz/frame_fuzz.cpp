// The bytes of a LinkFrame, as logs and clients read them.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "wire/frame_codec.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto frame = taclink::wire::DecodeFrame({reinterpret_cast<const char*>(data), size});
  if (!frame.ok()) {
    if (frame.error().message.empty()) std::abort();
    return 0;
  }
  // What was decoded can be encoded and is then accepted again.
  const std::string bytes = taclink::wire::EncodeFrame(frame->link, frame->state, taclink::Detail::kFull);
  if (!taclink::wire::DecodeFrame(bytes).ok()) std::abort();
  return 0;
}
