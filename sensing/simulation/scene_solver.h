#pragma once

#include <string>
#include <utility>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/played_scene.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_skin.h"
#include "sensing/simulation/skin_history.h"

namespace taclink {

/// How near what would be played halfway between two keys must be to what is solved there. It then becomes a
/// key itself, hence what is played is nearer.
struct SceneTolerance {
  double marker_mm = 0.02;
  double force_share = 0.02;  ///< of a contact's force, or of a tenth of its greatest if that is more
};

struct SolvedScene {
  std::vector<PlayedPart> parts;
  int keys = 0;
  int factorizations = 0;  ///< what it took, all but
};

/// Solves the equilibria along a scene: keys are set where its inputs have kinks, and halfway between keys
/// until what would be played there is what is solved. A skin that creeps (LinkModel::relaxation) is instead
/// followed in steps of time, from one on which the loads of the scene's beginning have acted for long; of a
/// loop, each time anew. Deterministic. Errors: kFailedPrecondition (no
/// equilibrium, or the skin snaps; with the contact's file and line and the time).
class SceneSolver {
 public:
  SceneSolver(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
              const SceneTolerance& tolerance = {}, SceneProgress progress = {});

  Result<SolvedScene> Solve();

  const ShellMesh& mesh() const { return skin_.mesh(); }
  const SceneLoads& loads() const { return loads_; }
  DiscSkin& skin() { return skin_; }

  /// The equilibrium at a time, from a state near it. False: none was found.
  bool SolveAt(const ScenePart& part, double time_s, SkinBalance& balance, SkinKey& key);
  /// A key's state `after_s` it, by its rates.
  SkinBalance BalanceOf(const SkinKey& key, double after_s) const;

 private:
  using Keys = std::vector<SkinKey>;
  struct Around {
    SkinLoad now, before, after;
    double either_side_s = 0;
  };

  static bool IsSame(const SkinLoad& a, const SkinLoad& b);
  Result<void> SolveFreeSkins();
  Result<SkinKey> Begin(const PlayedPart* before, const ScenePart& part);
  Result<SkinBalance> Jump(const SkinLoad& from, const SkinLoad& to, SkinBalance balance, double time_s);
  Result<SkinBalance> JumpAlong(const SkinLoad& from, const SkinLoad& to, SkinBalance balance, double time_s);
  Result<void> SolvePart(PlayedPart& part);
  Result<void> Reach(const ScenePart& part, double time_s, Keys& keys);
  Result<void> Refine(const ScenePart& part, const SkinKey& from, const SkinKey& to, Keys& keys);
  Result<void> CheckLoop(const SolvedScene& solved) const;

  Result<SolvedScene> SolveCreeping();
  Result<SkinBalance> BeginCreeping(const PlayedPart* before, const ScenePart& part, SkinBalance balance);
  Result<void> CreepThrough(PlayedPart& part, SkinBalance& balance);
  bool CreepTo(const PlayedPart& part, double time_s, SkinBalance& balance);
  SkinKey MakeCreepingKey(const ScenePart& part, double time_s, const SkinBalance& balance);

  SkinBalance BalanceBetween(const SkinKey& from, const SkinKey& to, double time_s) const;
  SkinBalance FromPlace(const Eigen::VectorXf& place) const;
  void PlaceNewDiscs(const SkinLoad& load, SkinBalance& balance) const;
  void WriteContacts(const SkinLoad& load, const SkinBalance& balance,
                     std::vector<KeyContact::Numbers>& numbers);
  bool Recall(const Around& around, double time_s, const SkinBalance& guess, SkinKey& key) const;
  SkinKey MakeKey(const ScenePart& part, const Around& around, double time_s, const SkinBalance& balance);
  Eigen::VectorXf PlaceOf(const SkinBalance& balance) const;
  void WriteRates(const Around& around, const SkinBalance& balance, Eigen::VectorXf& rate,
                  std::vector<KeyContact::Numbers>& contact_rates);
  bool IsFar(const ScenePart& part, const SkinKey& from, double time_s) const;
  double ErrorOf(const SkinKey& from, const SkinKey& to, const SkinKey& solved);
  double MarkerError(const Eigen::VectorXf& a, const Eigen::VectorXf& b) const;
  Error Refusal(double time_s, const std::string& why) const;

  LinkModel model_;
  Scene scene_;
  SceneTolerance tolerance_;
  SceneProgress progress_;
  DiscSkin skin_;
  SceneLoads loads_;
  SkinHistory history_;
  ShellState rest_;
  std::vector<float> greatest_n_;  // force, by contact
  std::vector<std::pair<Around, SkinKey>> solved_;
  std::string last_stop_;
};

}  // namespace taclink
