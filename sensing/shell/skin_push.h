#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/geometry.h"
#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {

/// A flat disc pressed radially against a marker's place. The nonlinear skin slides on it: three-dimensional
/// bricks need the same force within 0.6 % with and without friction (docs/reports/calculix.md).
struct SkinPush {
  int marker = 0;
  double depth_mm = 0;  ///< of the disc, from the uninflated radius
  double pressure_mpa = 0;
  /// Gravity less the link's acceleration, link frame; zero: weightless. Nothing to a model without density.
  Vec3 specific_force_mps2 = Vec3::Zero();
  double patch_diameter_mm = 5.5;
  /// Of the marker grid. A linear mesh coarser than the disc is pushed at one node.
  int refinement = 3;
  ForceModel force_model = ForceModel::kNonlinear;  ///< that or kLinear
};

struct SkinPushResult {
  double force_n = 0;        ///< on the disc, outwards; 0: the disc does not touch
  double inflation_mm = 0;   ///< of the marker's place without the disc, along the normal; with what sags
  int nodes_in_contact = 0;  ///< or points between them
  /// Nonlinear only: how far the wall under the disc gives way, mm; how the solution went.
  double indentation_mm = 0;
  std::string solution;
};

/// What a skin answers to a push; how a designer evaluates a skin.
/// Errors: kInvalidArgument (no such marker, not finite, deeper than the tube lets the skin go), kUnsupported
/// (another force model), kFailedPrecondition (no equilibrium was found: how far it went and why it stopped).
Result<SkinPushResult> PushSkin(const LinkModel& model, const SkinPush& push);

/// How stiff a skin is against a flat disc, from where the disc begins to touch it.
struct SkinStiffness {
  double inflation_mm = 0;     ///< as in SkinPushResult
  double force_n = 0;          ///< at the indentation that was asked for
  double secant_n_per_mm = 0;  ///< that force over that indentation
  /// Slope of the force over the indentation from 0.1 to 0.2 of the thickness: the disc bears with its whole
  /// face, and the dent is still shallow.
  double onset_n_per_mm = 0;
};

/// A skin in equilibrium under pressure and weight, against which discs are pressed one after another; each
/// disc begins from that same equilibrium. The nonlinear shell. One thread.
class LoadedSkin {
 public:
  /// Errors: those of PushSkin.
  static Result<LoadedSkin> Make(const LinkModel& model, const KnownLoads& loads,
                                 const PressedSkinOptions& options = {.refinement = 3});
  LoadedSkin(LoadedSkin&&) noexcept;
  LoadedSkin& operator=(LoadedSkin&&) noexcept;
  ~LoadedSkin();

  /// As in SkinPushResult.
  double InflationMm(int marker) const;
  const PressedSkin& skin() const { return *skin_; }

  /// To each depth in turn, rising, from the uninflated radius (SkinPush::depth_mm). Errors: those of
  /// PushSkin.
  Result<std::vector<SkinPushResult>> Push(int marker, std::span<const double> depths_mm,
                                           double patch_diameter_mm);
  /// The same, as far as equilibria are found: fewer results than depths, and why it ends there.
  struct PushedAsFar {
    std::vector<SkinPushResult> results;
    Result<void> end;
  };
  PushedAsFar PushAsFar(int marker, std::span<const double> depths_mm, double patch_diameter_mm);
  /// `indentation_mm`: of the disc, from the surface under these loads; positive. Errors: those of PushSkin.
  Result<SkinStiffness> Stiffness(int marker, double indentation_mm, double patch_diameter_mm);

 private:
  LoadedSkin(const LinkModel& model, std::unique_ptr<PressedSkin> skin);

  LinkModel model_;
  std::unique_ptr<PressedSkin> skin_;
  ShellState untouched_;
};

/// The deepest that a disc can be asked to go at a marker, from the uninflated radius: to the tube, or to the
/// axis where there is no tube, mm.
double RoomBehindMm(const LinkModel& model, int marker);

}  // namespace taclink
