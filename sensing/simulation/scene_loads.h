#pragma once

#include <span>
#include <vector>

#include "sensing/shell/disc_skin.h"
#include "sensing/simulation/contact_plan.h"
#include "sensing/simulation/patch.h"
#include "sensing/simulation/scene.h"

namespace taclink {

/// A stretch of a scene's time in which what acts on the skin changes smoothly.
struct ScenePart {
  double begin_s = 0, end_s = 0;
  std::vector<bool> pressing;  ///< by contact
  bool still = false;          ///< nothing changes
};

/// What acts on the skin of a link as a scene plays.
class SceneLoads {
 public:
  SceneLoads(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
             const ShellMesh& mesh);

  const std::vector<ScenePart>& parts() const { return parts_; }
  const std::vector<ContactPlan>& plans() const { return plans_; }

  /// The discs that are on are those of `on_at_s`, so that loads around a time can be compared. Times
  /// somewhat beyond the part go on as the part does.
  SkinLoad At(const ScenePart& part, double time_s, double on_at_s) const;
  SkinLoad At(const ScenePart& part, double time_s) const { return At(part, time_s, time_s); }

  /// The tube stops a contact before the depth that the scene asks for.
  bool StopsShort(size_t contact, const SkinLoad& load, double time_s) const;

  /// Pressures at which to give the skin without contacts, for where contacts of a given depth begin; none if
  /// there are none of those, or no pressure.
  std::vector<double> FreePressures() const;
  const std::vector<ShellState>& free_skins() const { return free_skins_; }
  void SetFreeSkins(std::vector<ShellState> states) { free_skins_ = std::move(states); }

  /// How deep the face of a disc is that just touches a skin in this state; negative: outside.
  double TouchingDepth(double diameter_mm, const SkinSpot& spot, const ShellState& state) const;
  double TouchingDepth(size_t contact, const SkinSpot& spot, const ShellState& state) const {
    return TouchingDepth(scene_.contacts[contact].patch_diameter_mm, spot, state);
  }
  /// The part at a time of the scene.
  const ScenePart& PartAt(double time_s) const;

 private:
  void FindParts();
  double PressureMpa(const ScenePart& part, double time_s) const;
  double AskedDepth(size_t contact, const SkinSpot& spot, double level, double pressure_mpa) const;
  double FreeDepth(size_t contact, const SkinSpot& spot, double pressure_mpa) const;

  LinkModel model_;
  Scene scene_;
  std::vector<ContactPlan> plans_;
  std::vector<ScenePart> parts_;
  mutable PatchFinder finder_;
  mutable std::vector<NodeWeight> weights_;
  std::vector<ShellState> free_skins_;
};

}  // namespace taclink
