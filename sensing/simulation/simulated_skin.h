#pragma once

#include <functional>
#include <memory>
#include <string>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/handling.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// Is told how much of a scene is solved, from 0 to 1.
using SceneProgress = std::function<void(double share)>;

/// A skin on which a scene plays. All that takes long is done at construction.
class SimulatedSkin {
 public:
  /// The skin that the scene asks for. Errors: kInvalidArgument (a contact that is not on this model),
  /// kFailedPrecondition (the nonlinear skin has no equilibrium for what the scene does, or leaves it in a
  /// jump); with the scene's file and line.
  static Result<std::unique_ptr<SimulatedSkin>> Make(const LinkModel& model, const Scene& scene,
                                                     const SceneProgress& progress = {});

  virtual ~SimulatedSkin() = default;

  /// The truth at a time since the scene's start, which goes on for ever if the scene loops and stands still
  /// after its end if not. Reuses the truth's buffers.
  virtual void Evaluate(double time_s, SkinTruth& truth) = 0;

  /// What a user does to the skin from the next moment on, over what the scene does; see CheckHandling. A
  /// skin that can't be handled goes on as its scene does.
  virtual void Handle(const Handling&) {}

  /// What was solved beforehand, in words; empty: nothing worth telling.
  virtual std::string Preparation() const { return {}; }

 protected:
  SimulatedSkin() = default;
  SimulatedSkin(const SimulatedSkin&) = default;
  SimulatedSkin& operator=(const SimulatedSkin&) = default;
};

}  // namespace taclink
