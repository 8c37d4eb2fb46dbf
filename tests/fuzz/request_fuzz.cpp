// The bytes of any request; the first byte says of which call.
#include <cstdint>
#include <cstdlib>

#include "server/rpc/requests/request_check.h"
#include "server/rpc/services/link_calls.h"
#include "server/rpc/streams/replay_request.h"
#include "taclink/v1/operations.pb.h"
#include "taclink/v1/recording.pb.h"
#include "taclink/v1/simulation.pb.h"
#include "taclink/v1/tactile.pb.h"

using namespace taclink;
using namespace taclink::server;

namespace {

template <typename T>
bool Good(const Result<T>& result) {
  if (!result.ok() && result.error().message.empty()) std::abort();
  return result.ok();
}

template <typename Request>
void Parse(const grpc::ByteBuffer& bytes) {
  Good(ParseRequest<Request>(bytes));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const grpc::Slice slice(data + 1, size - 1);
  const grpc::ByteBuffer bytes(&slice, 1);
  constexpr void (*kParsers[])(const grpc::ByteBuffer&) = {&Parse<v1::CalibrateRequest>,
                                                           &Parse<v1::TareRequest>,
                                                           &Parse<v1::StreamContactsRequest>,
                                                           &Parse<v1::StreamEventsRequest>,
                                                           &Parse<v1::GetForceHistoryRequest>,
                                                           &Parse<v1::SetThresholdsRequest>,
                                                           &Parse<v1::StreamPreviewRequest>,
                                                           &Parse<v1::SetForceModelRequest>,
                                                           &Parse<v1::RestartLinkRequest>,
                                                           &Parse<v1::StartRecordingRequest>,
                                                           &Parse<v1::DownloadLogRequest>,
                                                           &Parse<v1::ControlReplayRequest>,
                                                           &Parse<v1::GetReplayPicturesRequest>,
                                                           &Parse<v1::UpdateJointStatesRequest>,
                                                           &Parse<v1::UpdatePressureRequest>,
                                                           &Parse<v1::UpdateAttitudeRequest>,
                                                           &Parse<v1::PressRequest>,
                                                           &Parse<v1::SetScenePressureRequest>,
                                                           &Parse<v1::SetPressureRequest>};
  constexpr size_t kCount = std::size(kParsers);
  const size_t call = data[0] % (kCount + 2);
  if (call < kCount) {
    kParsers[call](bytes);
  } else if (call == kCount) {
    const auto order = ParseReplayRequest(bytes);
    if (Good(order) && (order->player.speed < 0 || order->player.from_utc_ns < 0)) std::abort();
  } else if (const auto request = ParseRequest<v1::SetCameraRequest>(bytes); Good(request)) {
    const auto order = ParseCameraRequest(*request);
    if (Good(order) && order->settings.exposure_100us && *order->settings.exposure_100us < 1) std::abort();
  }
  return 0;
}
