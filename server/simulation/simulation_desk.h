#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "sensing/core/clock.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/handling.h"
#include "sensing/simulation/scene.h"
#include "server/simulation/simulated_regulator.h"

namespace taclink::server {

/// What users do to one simulated link: their calls change it, the link's source reads it once a frame.
/// Outlives the source, so that a link that is started again is still handled. Any thread.
class SimulationDesk {
 public:
  /// `regulator`: inflates the skin; null: none does.
  SimulationDesk(LinkModel model, Scene scene, Clock& clock,
                 std::shared_ptr<SimulatedRegulator> regulator = nullptr);

  /// `hold_s`: the body is taken off when no other Press of it has come for so long; 0: it stays. Errors: as
  /// CheckHandling; then nothing has changed.
  Result<void> Press(const PressedBody& body, double hold_s);
  /// Errors: kNotFound (no such body). 0: all.
  Result<void> Release(uint64_t body_id);
  /// Errors: as CheckHandling; kFailedPrecondition (a regulator sets the pressure).
  Result<void> SetPressure(std::optional<double> pressure_mpa);
  Result<void> MoveJoint(std::optional<double> joint_rad);

  Handling Now();

  const LinkModel& model() const { return model_; }

 private:
  Result<void> Change(Handling changed);
  void DropExpired();

  // Constant after construction.
  const LinkModel model_;
  const Scene scene_;
  Clock& clock_;
  const std::shared_ptr<SimulatedRegulator> regulator_;

  std::mutex mutex_;
  // Guarded by mutex_.
  Handling handling_;
  std::vector<int64_t> until_ns_;  // by body of handling_, monotonic; 0: it stays
};

}  // namespace taclink::server
