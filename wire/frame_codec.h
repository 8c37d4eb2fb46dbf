#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "sensing/core/link_state.h"
#include "sensing/core/result.h"
#include "taclink/v1/frame.pb.h"
#include "wire/detail.h"

namespace taclink::wire {

/// Which link of the arm a frame belongs to.
struct LinkId {
  std::string name;
  uint32_t index = 0;
};

/// Writes `state` at `detail` into `out`, whose buffers are reused.
void Fill(const LinkId& link, const LinkState& state, Detail detail, v1::LinkFrame& out);

/// The same as the bytes of a LinkFrame.
std::string EncodeFrame(const LinkId& link, const LinkState& state, Detail detail);

/// What stands before the bytes of a LinkFrame in a StreamFramesResponse that holds it, so that the frame
/// itself is encoded once for all who want it.
std::string FrameResponsePrefix(size_t frame_bytes);

/// What makes a LinkFrame unchanged (LinkFrame.unchanged) when it stands after its bytes.
std::string UnchangedMark();

/// Likewise for one that comes from a log (LinkFrame.replayed).
std::string ReplayedMark();

struct DecodedFrame {
  LinkId link;
  Detail detail = Detail::kContacts;
  LinkState state;  ///< empty where the level of detail left out; positions come back in single precision
};
/// Errors: kInvalidArgument (not a LinkFrame, or arrays whose lengths do not fit each other).
Result<DecodedFrame> DecodeFrame(std::string_view bytes);
Result<DecodedFrame> FromWire(const v1::LinkFrame& frame);

}  // namespace taclink::wire
