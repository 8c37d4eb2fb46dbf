#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sensing/camera/triangulation.h"
#include "sensing/core/link_model.h"

namespace taclink {

struct RingNumberingOptions {
  /// A triangulated marker is off its ring's z by at most this, in ring pitches.
  double max_z_error = 0.15;
  double max_ray_gap_mm = 1.2;  ///< between the two cameras' rays to one marker
  double max_outward_mm = 15;   ///< beyond the radius at rest
  /// A label that only one camera supports holds if its radial displacement is off the neighbours' line by
  /// at most this part of what the next ring's label would be off.
  double max_single_error = 0.35;
  /// A pair of detections holds if no other pairing of either is as cheap but for this.
  double min_margin = 2.5;
  double sigma_rival_mm = 2.5;  ///< of the radial displacement off the neighbours' line, for that
  double max_rival_cost = 4;    ///< of the displacement, for that
  double sigma_rest_mm = 0.8;   ///< the same where nothing is displaced
  /// Behind rings that a camera does not see, so many in a row must hold again: a few spots beside the rays
  /// of the other camera meet them by chance.
  int min_run = 4;
  // Weights of the alignment: standard deviations, and costs in squared ones.
  double sigma_z = 0.06;  ///< ring pitches
  double sigma_gap_mm = 0.6;
  double sigma_bend_mm = 6;  ///< radial displacement from ring to ring
  double miss_cost = 5;      ///< a camera does not see a ring
  double false_cost = 6;     ///< a detection is no marker
};

/// Finds which rings a path's detections are. Each camera gives a chain of detections in the order of the
/// rings, some rings missing, some detections false. The cheapest alignment of both chains with the rings is
/// found by dynamic programming over (ring, used of top, used of bottom) [needleman1970]. Evidence: where two
/// rays meet, z must be that of the ring (the skin hardly moves along its axis), and the radial displacement
/// runs smoothly from one clamped end to the other, beside what the paths around show. Every label of the
/// result is then checked by itself and dropped where another ring would do as well; the usual radius does
/// where a gap in both chains leaves the count open.
class RingNumbering {
 public:
  RingNumbering(const LinkModel& model, RingNumberingOptions options);

  /// `top`, `bottom`: rays of a path's detections, rising z. `around_mm`: radial displacements (outwards) by
  /// ring that the paths around have; empty: not known, as at rest. Afterwards LabelOf says which place in
  /// the chain each ring has.
  void Number(std::span<const SightRay> top, std::span<const SightRay> bottom,
              std::span<const double> around_mm = {});
  /// Place in that camera's chain of the ring (from 0); -1: not seen, or dropped.
  int LabelOf(CameraId id, int ring) const { return labels_[Index(id)][static_cast<size_t>(ring)]; }

  /// Radial displacement (outwards) of a ring that has a label, mm; None: it has none.
  std::optional<double> DisplacementOf(int ring) const {
    const auto k = static_cast<size_t>(ring);
    if (!known_[k] || (labels_[0][k] < 0 && labels_[1][k] < 0)) return std::nullopt;
    return bends_mm_[k] + usual_radius_mm_[k] - ring_radius_mm_[k];
  }

  /// Longest chain that is used.
  int max_chain() const { return max_chain_; }

 private:
  enum Move : uint8_t { kStart, kFalseTop, kFalseBottom, kNone, kTopOnly, kBottomOnly, kPair };
  struct State {
    double cost = 0;
    double bend_mm = 0;  // of the last ring that was seen
    Move move = kStart;
  };
  struct Pair {
    double z_mm = 0, radius_mm = 0, gap_mm = 0;
    int ring = -1;  // on which it may be; -1: none
  };

  State& At(int ring, int top, int bottom);
  const Pair& PairOf(int top, int bottom) const {
    return pairs_[static_cast<size_t>(top * max_chain_ + bottom)];
  }
  void MeetAll();
  int RingAt(double z_mm, double radius_mm) const;
  double PairCost(const Pair& pair, int ring) const;
  bool AlignPlainly();
  void Align();
  void Relax(int ring, int top, int bottom);
  void Offer(int ring, int top, int bottom, double cost, double bend_mm, Move move);
  void ReadBack();
  void FindBends();
  double RivalCost(const Pair& pair, int ring) const;
  double RivalCost(const Pair& pair, int ring, bool counted) const;
  void Count();
  void DropAmbiguousPairs();
  void DropUnsupported();
  void DropShortRuns(CameraId id);
  bool HasNeighbour(CameraId id, int ring) const;
  void CheckSingles();
  bool SingleHolds(CameraId id, int ring, double expected_mm) const;
  /// Of a chain's detection if it is on that ring; None: not possible there.
  std::optional<double> Bend(CameraId id, int place, int ring) const;
  double ExpectedBend(int ring) const;

  const RingNumberingOptions options_;
  int rings_, max_chain_;
  double tube_radius_mm_;
  std::vector<double> ring_z_mm_, ring_radius_mm_, ring_pitch_mm_;  // of the markers at rest
  double length_mm_;
  std::vector<double> usual_radius_mm_;  // of the rings at rest, or of the paths around

  std::array<std::span<const SightRay>, kCameraCount> chains_;
  std::vector<Pair> pairs_;
  std::vector<State> states_;
  std::array<std::vector<int>, kCameraCount> labels_;
  std::vector<double> bends_mm_;  // outwards, off the usual radius; by ring, where known_
  std::vector<bool> known_;
  std::vector<uint8_t> counted_;   // by ring: in one camera's chain there is no gap before it
  std::vector<uint8_t> doubtful_;  // by ring; 1: the top label, 2: the bottom one
};

}  // namespace taclink
