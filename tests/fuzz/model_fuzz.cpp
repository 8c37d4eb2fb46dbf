// A link model's file.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "sensing/model/model_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto model = taclink::ParseLinkModel("model.yaml", {reinterpret_cast<const char*>(data), size});
  if (!model.ok()) {
    if (model.error().message.empty()) std::abort();
    return 0;
  }
  // What is accepted can be used.
  for (const taclink::Vec3& marker : model->RestMarkers()) {
    if (!marker.allFinite()) std::abort();
  }
  return 0;
}
