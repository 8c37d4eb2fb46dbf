#pragma once

#include <memory>
#include <vector>

#include "sensing/simulation/patch.h"
#include "sensing/simulation/scene_solver.h"
#include "sensing/simulation/simulated_skin.h"
#include "sensing/simulation/skin_writer.h"

namespace taclink {

/// Nonlinear shell under pressure, rigid discs and the inner tube. Equilibria along the scene are solved at
/// construction (SceneSolver); a moment is then played from the two keys around it.
class NonlinearSkin final : public SimulatedSkin {
 public:
  /// Errors: those of SimulatedSkin::Make.
  static Result<std::unique_ptr<SimulatedSkin>> Make(const LinkModel& model, const Scene& scene);

  void Evaluate(double time_s, SkinTruth& truth) override;
  std::string Preparation() const override { return preparation_; }

 private:
  NonlinearSkin(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans, ShellMesh mesh,
                SolvedScene solved);
  void WriteContact(size_t index, double time_s, const SkinKey& from, const SkinKey& to, SkinTruth& truth);

  // Constant after construction.
  LinkModel model_;
  Scene scene_;
  std::vector<ContactPlan> plans_;
  ShellMesh mesh_;
  std::vector<PlayedPart> parts_;
  std::string preparation_;
  SkinWriter writer_;
  // Of the current moment.
  PatchFinder finder_;
  std::vector<NodeWeight> center_;
  Eigen::VectorXf place_;
  SkinNodes nodes_;
};

}  // namespace taclink
