#include "server/simulation/simulation_desk.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace taclink::server {

SimulationDesk::SimulationDesk(LinkModel model, Scene scene, Clock& clock)
    : model_(std::move(model)), scene_(std::move(scene)), clock_(clock) {}

Result<void> SimulationDesk::Press(const PressedBody& body, double hold_s) {
  const std::lock_guard lock(mutex_);
  DropExpired();
  Handling changed = handling_;
  auto& bodies = changed.bodies;
  const auto known = std::ranges::find(bodies, body.id, &PressedBody::id);
  const auto index = static_cast<size_t>(known - bodies.begin());
  if (known == bodies.end())
    bodies.push_back(body);
  else
    *known = body;
  if (auto good = Change(std::move(changed)); !good) return good;
  until_ns_.resize(handling_.bodies.size(), 0);
  until_ns_[index] = hold_s > 0 ? clock_.MonotonicNs() + std::llround(1e9 * hold_s) : 0;
  return {};
}

Result<void> SimulationDesk::Release(uint64_t body_id) {
  const std::lock_guard lock(mutex_);
  DropExpired();
  auto& bodies = handling_.bodies;
  if (body_id == 0) {
    bodies.clear();
    until_ns_.clear();
    return {};
  }
  const auto known = std::ranges::find(bodies, body_id, &PressedBody::id);
  if (known == bodies.end())
    return Error{ErrorCode::kNotFound, "no body " + std::to_string(body_id) + " presses on this link"};
  until_ns_.erase(until_ns_.begin() + (known - bodies.begin()));
  bodies.erase(known);
  return {};
}

Result<void> SimulationDesk::SetPressure(std::optional<double> pressure_mpa) {
  const std::lock_guard lock(mutex_);
  Handling changed = handling_;
  changed.pressure_mpa = pressure_mpa;
  return Change(std::move(changed));
}

Result<void> SimulationDesk::MoveJoint(std::optional<double> joint_rad) {
  const std::lock_guard lock(mutex_);
  Handling changed = handling_;
  changed.joint_rad = joint_rad;
  return Change(std::move(changed));
}

Handling SimulationDesk::Now() {
  const std::lock_guard lock(mutex_);
  DropExpired();
  return handling_;
}

Result<void> SimulationDesk::Change(Handling changed) {
  if (auto good = CheckHandling(model_, scene_, changed); !good) return good;
  handling_ = std::move(changed);
  return {};
}

void SimulationDesk::DropExpired() {
  const int64_t now_ns = clock_.MonotonicNs();
  for (size_t i = until_ns_.size(); i-- > 0;) {
    if (until_ns_[i] == 0 || until_ns_[i] > now_ns) continue;
    until_ns_.erase(until_ns_.begin() + static_cast<std::ptrdiff_t>(i));
    handling_.bodies.erase(handling_.bodies.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace taclink::server
