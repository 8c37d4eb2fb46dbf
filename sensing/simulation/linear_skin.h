#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/shell/linear_shell.h"
#include "sensing/simulation/contact_balance.h"
#include "sensing/simulation/contact_plan.h"
#include "sensing/simulation/patch.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_skin.h"
#include "sensing/simulation/skin_truth.h"
#include "sensing/simulation/skin_writer.h"

namespace taclink {

/// Elements per interval of the marker grid that a linear skin has unless told: finer than an estimator's.
inline constexpr int kSimulatedRefinement = 3;

/// Linear shell: small displacements, loads that superpose exactly. Responses to unit loads are computed at
/// construction; a moment then costs only sums. A contact is an even load over its patch.
class LinearSkin final : public SimulatedSkin {
 public:
  /// Errors: those of SimulatedSkin::Make; kInvalidArgument (a model that creeps). `shell` of that model may
  /// be shared by several scenes; null: one of kSimulatedRefinement.
  static Result<std::unique_ptr<SimulatedSkin>> Make(const LinkModel& model, const Scene& scene,
                                                     std::shared_ptr<const LinearShell> shell = nullptr);

  void Evaluate(double time_s, SkinTruth& truth) override;

 private:
  // Translations then rotations, three numbers a node each.
  using State = Eigen::VectorXd;
  struct SkinContact {
    ContactPlan plan;
    State response;                 // to 1 N at the current spot
    std::vector<NodeWeight> patch;  // of it
    std::vector<NodeWeight> center;
    SkinSpot spot;
    double normal_share = 1;  // resultant of unit loads that each point inwards
    double level = 0;         // of the ramp, now
  };

  LinearSkin(const LinkModel& model, const Scene& scene, std::shared_ptr<const LinearShell> shell,
             std::vector<SkinContact> contacts);
  void LearnResponses(SkinContact& contact, double diameter_mm);
  void Place(SkinContact& contact, double time_s, double diameter_mm);
  ContactForces Forces(double pressure_mpa);
  double FreeScale(const State& without, const State& contacts) const;
  void WriteContact(size_t index, ContactForce force, SkinTruth& truth) const;

  Vec3 Shift(const State& state, int node) const { return state.segment<3>(Eigen::Index{3} * node); }
  const ShellMesh& mesh() const { return shell_->mesh(); }
  const Vec3& Normal(int node) const { return mesh().normals[static_cast<size_t>(node)]; }  // at rest
  Vec3 Director(int node) const;
  double InwardDepth(const State& state, const SkinContact& contact) const;

  // Constant after construction.
  LinkModel model_;
  Scene scene_;
  std::shared_ptr<const LinearShell> shell_;
  PatchFinder finder_;
  SkinWriter writer_;
  State per_pressure_;                 // 1 MPa
  std::vector<Vec3> radial_;           // by node, unit, away from the axis
  std::vector<int> response_of_node_;  // index into unit_responses_; -1: never loaded by a moving contact
  std::vector<State> unit_responses_;  // to 1 N inwards
  // Of the current moment.
  std::vector<SkinContact> contacts_;
  std::vector<size_t> active_;  // indices of those that push
  State pressed_, state_;
  SkinNodes nodes_;
};

}  // namespace taclink
