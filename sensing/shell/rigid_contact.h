#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sensing/shell/element_load.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/rigid_body.h"

namespace taclink {

struct RigidContactOptions {
  double offset_mm =
      0;  ///< of the touched surface from the mid-surface: half the thickness outside, or inside
  double spacing_mm = 1;  ///< of the points that are kept out of the body
  /// Pressure by penetration, N/mm^3. The stiffer, the smaller the penetration and the more steps a solution
  /// takes.
  double stiffness_n_mm3 = 0;
  bool sticks = false;  ///< no sliding once touched; else no friction
};

/// A rigid body that a shell can't enter: points spread over its mid-surface are held half a thickness
/// outside the body by a stiff one-sided bedding. (Points of the touched wall would do the same, were it not
/// that a force there turns the director over.) Copies share the points, which are most of its memory.
class RigidContact final : public ElementLoad {
 public:
  RigidContact(const NonlinearShell& shell, const RigidContactOptions& options);

  void SetBody(const RigidBody& body);
  const RigidBody& body() const { return body_; }
  /// Instead of the options'. Of what sticks, only before anything is held.
  void SetStiffness(double n_mm3) { options_.stiffness_n_mm3 = n_mm3; }

  /// Holds what touches where it is, and lets go what does not: call with an equilibrium. True: something
  /// that had been held was let go, so that this is no equilibrium any more.
  bool Hold(const ShellState& state);

  /// All that is held, to go back to.
  struct Grip;
  Grip GripNow() const;
  void Restore(const Grip& grip);

  struct Summary {
    Vec3 force_n = Vec3::Zero();     ///< on the shell
    Vec3 center_mm = Vec3::Zero();   ///< of pressure, on the body
    Vec3 moment_nmm = Vec3::Zero();  ///< about the link frame's origin
    double area_mm2 = 0;             ///< of the touched points, at rest
    double penetration_mm = 0;       ///< largest
    int points = 0;
  };
  Summary Summarize(const ShellState& state) const;

  void Add(DerivativeOrder order, int element, const ElementState& state,
           ElementResponse& response) const override;

 private:
  // Relative to the body's place when it was first set; it can't slide across the normal there.
  struct HeldPoint {
    Vec3 at_mm, normal;
  };
  struct Point {
    Eigen::Vector4d weights;  // of the corners
    double area_mm2 = 0;
  };
  struct Points {
    std::vector<Point> all;
    std::vector<size_t> first;  // by element, and behind the last
  };
  static Points Spread(const NonlinearShell& shell, double spacing_mm);
  void AddPoint(size_t point, const ElementState& state, DerivativeOrder order,
                ElementResponse& response) const;
  bool IsHeld(size_t point) const { return !held_.empty() && held_[point]; }
  Vec3 SlipOf(size_t point, const Vec3& at_mm) const;
  Vec3 PlaceOf(size_t point, const ElementState& state) const;
  bool IsFar(size_t element, const ElementState& state) const;

  const NonlinearShell& shell_;
  RigidContactOptions options_;
  RigidBody body_;
  RigidBody grown_;               // by half the shell's thickness
  Vec3 moved_mm_ = Vec3::Zero();  // of the body since it was first set
  bool has_body_ = false;
  std::shared_ptr<const Points> points_;        // of all copies
  std::vector<std::optional<HeldPoint>> held_;  // by point; empty: nothing can be held
  std::vector<int> held_count_;                 // by element
};

struct RigidContact::Grip {
  struct Entry {
    size_t element, point;
    HeldPoint held;
  };
  std::vector<Entry> entries;
};

}  // namespace taclink
