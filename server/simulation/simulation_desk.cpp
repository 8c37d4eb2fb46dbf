#include "server/simulation/simulation_desk.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "sensing/core/units.h"

namespace taclink::server {
namespace {

// A vented skin is left to its scene, which needs no solving.
constexpr double kVentedKpa = 1e-4;

}  // namespace

SimulationDesk::SimulationDesk(LinkModel model, Scene scene, Clock& clock,
                               std::shared_ptr<SimulatedRegulator> regulator)
    : model_(std::move(model)), scene_(std::move(scene)), clock_(clock), regulator_(std::move(regulator)) {}

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
  if (regulator_ != nullptr && pressure_mpa)
    return Error{
        ErrorCode::kFailedPrecondition,
        "a simulated regulator sets the pressure of this link: use SetPressure (taclink pressure set)"};
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
  Handling now = handling_;
  if (regulator_ == nullptr) return now;
  const SimulatedRegulator::Air air = regulator_->AirNow();
  if (air.kpa < kVentedKpa && air.kpa_per_s <= 0) return now;
  now.pressure_mpa = kMpaPerKpa * air.kpa;
  now.pressure_mpaps = kMpaPerKpa * air.kpa_per_s;
  return now;
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
