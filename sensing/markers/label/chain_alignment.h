#pragma once

#include <cstddef>
#include <vector>

namespace taclink {

struct ChainAlignmentOptions {
  double sigma_slope = 0.6;            ///< of the radial displacement along the skin, mm per mm
  double false_cost = 6;               ///< a spot is no marker
  double max_cost = 2;                 ///< of a step in the displacement: a dent may be as steep as it likes
  int max_missing = 6, max_false = 4;  ///< in a row
};

/// Aligns the spots of one path with its rings, both in the order in which they follow each other, by dynamic
/// programming [needleman1970]. Says of every spot how much dearer the next best alignment is that gives it
/// another ring or none. Costs are squared standard deviations.
class ChainAlignment {
 public:
  explicit ChainAlignment(ChainAlignmentOptions options = {}) : options_(options) {}

  /// `ring_z_mm`: the rings' places along the skin, rising; the skin is clamped at 0 and `length_mm`.
  /// `missing_cost`: of not seeing a ring.
  void Start(int spots, const std::vector<double>& ring_z_mm, double length_mm,
             const std::vector<double>& missing_cost);
  /// A spot may be on a ring (both from 0, spots in the order of the rings): what speaks against it by
  /// itself, and the radial displacement it then has.
  void Allow(int spot, int ring, double cost, double displacement_mm);
  void Solve();

  /// -1: none.
  int RingOf(int spot) const { return rings_of_[static_cast<size_t>(spot)]; }
  double MarginOf(int spot) const { return margins_[static_cast<size_t>(spot)]; }

 private:
  struct State {
    bool allowed = false;
    double cost = 0, displacement_mm = 0;
    double forward = 0, backward = 0;  // best of what is before (with this one), after
  };
  State& At(int spot, int ring) { return states_[static_cast<size_t>(spot * ring_count_ + ring)]; }
  double StepCost(double dz_mm, double change_mm) const;
  double GapCost(int spot_before, int ring_before, int spot_after, int ring_after) const;
  template <typename Visit>
  void ForEachNext(int spot, int ring, Visit visit);
  void Forward();
  void Backward();
  void FindMargins();

  const ChainAlignmentOptions options_;
  int spot_count_ = 0, ring_count_ = 0;
  double length_mm_ = 0;
  std::vector<double> ring_z_mm_, missing_sums_;
  std::vector<State> states_;
  std::vector<int> rings_of_;
  std::vector<double> margins_, without_;  // without_: best alignment in which a spot is false
};

}  // namespace taclink
