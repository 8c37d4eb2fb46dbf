#pragma once

#include <memory>
#include <vector>

#include "sensing/simulation/live_skin.h"
#include "sensing/simulation/patch.h"
#include "sensing/simulation/scene_solver.h"
#include "sensing/simulation/simulated_skin.h"
#include "sensing/simulation/skin_writer.h"

namespace taclink {

/// Nonlinear shell under pressure, rigid discs and the inner tube. Equilibria along the scene are solved at
/// construction (SceneSolver); a moment is then played from the two keys around it. While a user handles the
/// skin, moments are solved as they come (LiveSkin).
class NonlinearSkin final : public SimulatedSkin {
 public:
  /// Errors: those of SimulatedSkin::Make.
  static Result<std::unique_ptr<SimulatedSkin>> Make(const LinkModel& model, const Scene& scene,
                                                     const SceneProgress& progress = {});

  void Evaluate(double time_s, SkinTruth& truth) override;
  void Handle(const Handling& handling) override { handling_ = handling; }
  std::string Preparation() const override { return preparation_; }

 private:
  NonlinearSkin(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans, ShellMesh mesh,
                SolvedScene solved, std::vector<ShellState> free_skins);
  bool EvaluateLive(double time_s, SkinTruth& truth);
  void Play(double scene_time_s, SkinTruth& truth);
  void WriteContact(size_t index, double time_s, const SkinKey& from, const SkinKey& to, SkinTruth& truth);

  // Constant after construction.
  LinkModel model_;
  Scene scene_;
  std::vector<ContactPlan> plans_;
  ShellMesh mesh_;
  std::vector<PlayedPart> parts_;
  std::string preparation_;
  std::vector<ShellState> free_skins_;
  SkinWriter writer_;
  // Of the current moment.
  PatchFinder finder_;
  std::vector<NodeWeight> center_;
  Eigen::VectorXf place_;
  SkinNodes nodes_;
  std::vector<KeyContact> pressing_;  // where it was played
  // Of what a user does.
  Handling handling_;
  std::unique_ptr<LiveSkin> live_;  // null: never handled yet
  bool is_live_ = false;
  std::string trouble_;
};

}  // namespace taclink
