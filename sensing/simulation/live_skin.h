#pragma once

#include <span>
#include <string>
#include <vector>

#include "sensing/shell/disc_skin.h"
#include "sensing/simulation/handled_motion.h"
#include "sensing/simulation/played_scene.h"
#include "sensing/simulation/scene_loads.h"
#include "sensing/simulation/skin_history.h"
#include "sensing/simulation/skin_truth.h"
#include "sensing/simulation/skin_writer.h"

namespace taclink {

/// A skin under what its scene does and what a user does to it besides, solved while it is played: an
/// equilibrium every kKeySpanS, one ahead of the time that is asked for, and straight lines between them. A
/// skin that creeps keeps its history from key to key; it never goes back to its scene, whose history is
/// another. One thread.
class LiveSkin {
 public:
  static constexpr double kKeySpanS = 0.1;

  /// `free_skins`: of the scene (SceneLoads::SetFreeSkins).
  LiveSkin(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
           std::vector<ShellState> free_skins);

  /// From a state of the scene on its own. False: it has no equilibrium near that.
  bool Begin(double time_s, const SkinNodes& nodes, std::span<const KeyContact> contacts);
  /// Time that does not go back. Sets nodes and the truth's contacts, pressure, joint and specific force.
  /// False: nothing is left of what the user did, or the skin could not follow (see trouble); the scene goes
  /// on alone.
  bool Evaluate(double time_s, const Handling& wanted, SkinNodes& nodes, SkinTruth& truth);
  /// Why bodies do not go on, or were taken off; empty: they do.
  const std::string& trouble() const { return trouble_; }

 private:
  struct Key {
    double time_s = 0;
    SkinNodes nodes;
    std::vector<TrueContact> contacts;
    double pressure_mpa = 0;
    Vec3 specific_force_mps2 = Vec3::Zero();
    JointMotion joint;
  };

  double SceneTime(double time_s) const { return scene_.SceneTime(time_s); }
  HandledGoal GoalAt(double time_s, const Handling& wanted) const;
  SkinLoad LoadAt(double time_s, const HandledMotion& motion) const;
  SkinLoad ElasticLoadAt(double time_s, const HandledMotion& motion) const {
    return history_.ElasticLoad(LoadAt(time_s, motion), time_s);
  }
  void BeginHistory(double time_s);
  bool Balance(double time_s, const HandledMotion& motion, SkinBalance guess);
  void PlaceNewDiscs(const SkinLoad& load, SkinBalance& balance) const;
  SkinBalance Predicted(double from_s, const HandledMotion& from, double to_s, const HandledMotion& to);
  double Reach(double from_s, const HandledMotion& from, double to_s, const HandledMotion& to,
               int most_factorizations, double& step);
  bool NextKey(double time_s, const Handling& wanted);
  void AddBodies(const std::vector<PressedBody>& wanted);
  void RemoveBodies();
  void ReadBack(const std::vector<TrueContact>& contacts);
  bool IsAlone(double time_s, const Handling& wanted) const;
  Key MakeKey(double time_s);
  void Interpolate(double time_s, SkinNodes& nodes, SkinTruth& truth) const;

  // Constant after construction.
  const LinkModel model_;
  const Scene scene_;
  const size_t scene_discs_;
  DiscSkin skin_;
  SceneLoads loads_;
  mutable PatchFinder finder_;
  mutable std::vector<NodeWeight> weights_;
  // Of the newest key.
  SkinBalance balance_;
  bool is_balance_newest_ = false;  // of what skin_ has solved, or tried to
  HandledMotion motion_;
  SkinHistory history_;
  double step_ = 1;  // of the way to a key, that a try for the next one takes
  int effort_ = 0;   // factorizations that the user's bodies may take now; negative: they wait
  Key from_, to_;
  std::string trouble_;
};

}  // namespace taclink
