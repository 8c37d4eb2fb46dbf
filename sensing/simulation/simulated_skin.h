#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/mechanics/linear_shell.h"
#include "sensing/simulation/contact_balance.h"
#include "sensing/simulation/patch.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// Elements per interval of the marker grid that a simulated skin has unless told: finer than an estimator's.
inline constexpr int kSimulatedRefinement = 3;

/// A skin on which a scene plays: linear shell, finer than the marker grid, so that the truth is not computed
/// on the mesh of whoever estimates it. Responses to unit loads are computed at construction; a moment then
/// costs only sums.
class SimulatedSkin {
 public:
  /// Errors: kInvalidArgument (a contact that is not on this model, with the scene's file and line).
  static Result<std::unique_ptr<SimulatedSkin>> Make(const LinkModel& model, const Scene& scene);
  /// The same with a shell of that model that several scenes share.
  static Result<std::unique_ptr<SimulatedSkin>> Make(const LinkModel& model, const Scene& scene,
                                                     std::shared_ptr<const LinearShell> shell);

  /// The truth at a time since the scene's start, which goes on for ever if the scene loops and stands still
  /// after its end if not. Reuses the truth's buffers.
  void Evaluate(double time_s, SkinTruth& truth);

  const LinkModel& model() const { return model_; }
  const ShellMesh& mesh() const { return shell_->mesh(); }

 private:
  // Translations then rotations, three numbers a node each.
  using State = Eigen::VectorXd;
  struct Spot {
    double angle_rad = 0, z_mm = 0;
  };
  struct SkinContact {
    Spot from, to;
    bool moves = false;
    State response;                 // to 1 N at the current spot
    std::vector<NodeWeight> patch;  // of it
    std::vector<NodeWeight> center;
    Spot spot;
    double normal_share = 1;  // resultant of unit loads that each point inwards
    double level = 0;         // of the ramp, now
  };

  SimulatedSkin(const LinkModel& model, const Scene& scene, std::shared_ptr<const LinearShell> shell,
                std::vector<SkinContact> contacts);
  void LearnResponses(SkinContact& contact, double diameter_mm);
  void Place(SkinContact& contact, double time_s, const SceneContact& plan);
  ContactForces Forces(double pressure_mpa);
  double FreeScale(const State& without, const State& contacts) const;
  void WriteWall(SkinTruth& truth) const;
  void WriteMarkers(SkinTruth& truth) const;
  void WriteContact(size_t index, ContactForce force, SkinTruth& truth) const;

  Vec3 Shift(const State& state, int node) const { return state.segment<3>(Eigen::Index{3} * node); }
  const Vec3& Normal(int node) const { return mesh().normals[static_cast<size_t>(node)]; }  // at rest
  Vec3 Director(int node) const;
  double InwardDepth(const State& state, const SkinContact& contact) const;

  // Constant after construction.
  LinkModel model_;
  Scene scene_;
  std::shared_ptr<const LinearShell> shell_;
  PatchFinder finder_;
  State per_pressure_;                       // 1 MPa
  std::vector<Vec3> radial_;                 // by node, unit, away from the axis
  std::vector<double> rest_wall_radius_mm_;  // by node
  std::vector<int> response_of_node_;  // index into unit_responses_; -1: never loaded by a moving contact
  std::vector<State> unit_responses_;  // to 1 N inwards
  // Of the current moment.
  std::vector<SkinContact> contacts_;
  std::vector<size_t> active_;  // indices of those that push
  State pressed_, state_;
};

}  // namespace taclink
