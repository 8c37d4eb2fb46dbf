#include "server/hub/deadband.h"

#include <algorithm>
#include <cmath>

namespace taclink::server {
namespace {

const Contact* Find(const LinkState& state, uint64_t id) {
  const auto at = std::find_if(state.contacts.begin(), state.contacts.end(),
                               [id](const Contact& contact) { return contact.id == id; });
  return at == state.contacts.end() ? nullptr : &*at;
}

// Written so that NaN is outside.
bool Below(const Vec3& change, double limit) {
  return change.squaredNorm() < limit * limit;
}

// A change of its magnitude alone counts, too: the resultant of a ring contact is always about zero.
bool ForcesWithin(double force_n, const LinkState& before, const LinkState& now) {
  for (const Contact& contact : now.contacts) {
    const Contact* old = Find(before, contact.id);
    const Vec3 change = old ? Vec3(contact.force_n - old->force_n) : contact.force_n;
    const double magnitude_n = contact.magnitude_n() - (old ? old->magnitude_n() : 0);
    if (!Below(change, force_n) || !(std::abs(magnitude_n) < force_n)) return false;
  }
  return std::ranges::all_of(before.contacts, [&](const Contact& old) {
    return Find(now, old.id) != nullptr || old.magnitude_n() < force_n;
  });
}

bool MarkersWithin(double move_mm, const LinkState& before, const LinkState& now) {
  const auto& from = before.shape.positions_mm;
  const auto& to = now.shape.positions_mm;
  for (size_t marker = 0; marker < to.size(); ++marker) {
    if (!Below(to[marker] - from[marker], move_mm)) return false;
  }
  return true;
}

}  // namespace

bool Within(const Deadband& deadband, const LinkState& before, const LinkState& now) {
  if (!deadband.on() || before.status != now.status) return false;
  if (before.has_forces() != now.has_forces()) return false;
  if (before.shape.positions_mm.size() != now.shape.positions_mm.size()) return false;
  if (deadband.force_n > 0 && !ForcesWithin(deadband.force_n, before, now)) return false;
  return deadband.move_mm <= 0 || MarkersWithin(deadband.move_mm, before, now);
}

}  // namespace taclink::server
