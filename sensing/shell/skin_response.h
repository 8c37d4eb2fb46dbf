#pragma once

#include <compare>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {

/// What a nonlinear skin answers to pressure and to a flat disc, for every Young's modulus E at once: with
/// s = pressure / E its displacements are functions of s alone, and its forces are E times such functions.
/// They are solved at equal steps of s, where asked for, and interpolated by cubics. Suction, which buckles a
/// skin, is left out: s >= 0, and the growth is the same on every path. One thread.
class SkinResponse {
 public:
  /// The model's material counts only for Poisson's ratio (0.5 for the neo-Hookean law).
  /// `refinement`: elements per interval of the marker grid. `progress`: called after each solution with
  /// their number so far.
  SkinResponse(const LinkModel& model, MaterialLaw law, int refinement,
               std::function<void(int)> progress = {});

  /// Of the markers' centres, by ring: displacement from rest, mm, radial and axial (link frame's z), and its
  /// derivative by s.
  struct Growth {
    std::vector<Vec2> mm, by_s;
  };
  /// Errors: kFailedPrecondition: there is no equilibrium that smaller pressures lead to.
  Result<Growth> GrowthAt(double s);

  struct Disc {
    int ring = 0;         ///< pressed against a marker of this ring, from 0
    double depth_mm = 0;  ///< from the uninflated radius
    double diameter_mm = 5.5;
    auto operator<=>(const Disc&) const = default;
  };
  /// Force on the disc over E, mm^2, and its derivative by s.
  struct Push {
    double mm2 = 0, by_s = 0;
  };
  /// Errors: those of GrowthAt and of PushSkin.
  Result<Push> PushAt(const Disc& disc, double s);

  const Material& material() const { return model_.material; }  ///< but for Young's modulus

 private:
  using Nodes = std::vector<std::optional<Result<double>>>;
  bool GrownTo(size_t node);
  bool Extend();
  const Result<double>& PushNode(Nodes& nodes, const Disc& disc, size_t node);
  void Solved();

  LinkModel model_;
  int refinement_;
  double growth_step_ = 0, push_step_ = 0;  // of s
  std::function<void(int)> progress_;
  int solved_ = 0;
  LinkModel growth_model_;                 // fewer paths
  std::unique_ptr<PressedSkin> skin_;      // at the last node of growth_
  std::vector<std::vector<Vec2>> growth_;  // by node, ring
  std::string end_of_growth_;              // why there can be no more nodes
  std::map<Disc, Nodes> pushes_;
};

}  // namespace taclink
