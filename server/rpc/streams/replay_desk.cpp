#include "server/rpc/streams/replay_desk.h"

#include <sys/random.h>

#include <array>
#include <cstdint>
#include <utility>

namespace taclink::server {

Result<std::string> ReplayDesk::Enter(std::weak_ptr<ReplayStream> stream) {
  std::array<uint8_t, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    return Error{ErrorCode::kUnavailable, "the system gives no random numbers; try again"};
  constexpr const char* kDigits = "0123456789abcdef";
  std::string id;
  for (const uint8_t byte : bytes) (id += kDigits[byte >> 4]) += kDigits[byte & 15];
  const std::lock_guard lock(mutex_);
  streams_[id] = std::move(stream);
  return id;
}

void ReplayDesk::Leave(const std::string& id) {
  const std::lock_guard lock(mutex_);
  streams_.erase(id);
}

Result<std::shared_ptr<ReplayStream>> ReplayDesk::Find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto at = streams_.find(id);
  auto stream = at == streams_.end() ? nullptr : at->second.lock();
  if (!stream)
    return Error{ErrorCode::kNotFound,
                 "there is no player of this id; a Replay call that is open tells its own"};
  return stream;
}

}  // namespace taclink::server
