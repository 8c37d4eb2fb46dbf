// The bytes of a StreamFramesRequest.
#include <grpcpp/support/byte_buffer.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "server/rpc/streams/stream_request.h"

using namespace taclink::server;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::vector<std::string> links = {"upper", "lower"};
  const grpc::Slice slice(data, size);
  const auto options = ParseStreamRequest({&slice, 1}, links, {});
  if (!options.ok()) {
    if (options.error().message.empty()) std::abort();
    return 0;
  }
  const SubscriberOptions& subscriber = options->subscriber;
  const bool good = (subscriber.links.empty() || subscriber.links.size() == links.size()) &&
                    std::isfinite(subscriber.max_rate_hz) && subscriber.max_rate_hz >= 0 &&
                    std::isfinite(subscriber.deadband.force_n) && subscriber.deadband.force_n >= 0 &&
                    std::isfinite(subscriber.deadband.move_mm) && subscriber.deadband.move_mm >= 0;
  if (!good) std::abort();
  // Any accepted subscription works.
  Hub hub(links.size(), [](size_t, const taclink::LinkState&, taclink::Detail) { return std::string(); });
  const auto subscription = hub.Subscribe(subscriber, [] {});
  for (int i = 0; i < 3; ++i) hub.Publish(0, std::make_shared<taclink::LinkState>());
  while (subscription->Take()) {
  }
  return 0;
}
