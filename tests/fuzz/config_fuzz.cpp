// The configuration's text.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "server/config/config.h"

using taclink::server::ConfigText;
using taclink::server::ParseConfig;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto config = ParseConfig("arm.yaml", {reinterpret_cast<const char*>(data), size}, "/etc/taclink");
  if (!config.ok()) {
    if (config.error().message.empty()) std::abort();
    return 0;
  }
  // What is printed reads back to the same.
  const std::string printed = ConfigText(*config);
  const auto again = ParseConfig("printed", printed, "/elsewhere");
  if (!again.ok() || ConfigText(*again) != printed) std::abort();
  return 0;
}
