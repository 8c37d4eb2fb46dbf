#include "server/hub/encoder.h"

#include "wire/frame_codec.h"

namespace taclink::server {

FrameEncoder MakeEncoder(const std::vector<std::string>& link_names) {
  std::vector<wire::LinkId> ids;
  for (const auto& name : link_names) ids.push_back({name, static_cast<uint32_t>(ids.size())});
  return [ids](size_t link, const LinkState& state, Detail detail) {
    return wire::EncodeFrame(ids[link], state, detail);
  };
}

}  // namespace taclink::server
