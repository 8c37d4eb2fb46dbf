#pragma once

#include <cstdint>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// By how much a link has to change to be news to a subscriber. 0: this quantity does not count; both 0:
/// every state is news.
struct Deadband {
  double force_n = 0;  ///< of any contact; one that begins or ends changes by its whole force
  double move_mm = 0;  ///< of any marker

  bool on() const { return force_n > 0 || move_mm > 0; }
};

/// A link that is within its deadband is sent this often.
inline constexpr int64_t kUnchangedPeriodNs = 1'000'000'000;

/// Whether `now` tells nothing new to somebody who has `before`: same status, all changes below the deadband.
/// A number that is none is always news.
bool Within(const Deadband& deadband, const LinkState& before, const LinkState& now);

}  // namespace taclink::server
