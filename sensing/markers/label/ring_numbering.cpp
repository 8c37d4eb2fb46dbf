#include "sensing/markers/label/ring_numbering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace taclink {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr int kMaxLag = 5;  // rings in a row that may be missing and still be aligned
constexpr int kSpare = 4;   // detections of a path beyond its rings that are looked at

double Square(double x) {
  return x * x;
}

}  // namespace

RingNumbering::RingNumbering(const LinkModel& model, RingNumberingOptions options)
    : options_(options),
      rings_(model.markers.rings()),
      max_chain_(rings_ + kSpare),
      tube_radius_mm_(model.tube_outer_radius_mm),
      length_mm_(model.length_mm) {
  for (int j = 0; j < rings_; ++j) {
    const Vec3 p = model.RestMarker(model.MarkerIndex(0, j));
    ring_z_mm_.push_back(p.z());
    ring_radius_mm_.push_back(p.head<2>().norm());
  }
  for (int j = 0; j < rings_; ++j) {
    const auto k = static_cast<size_t>(j);
    const double before = j > 0 ? ring_z_mm_[k] - ring_z_mm_[k - 1] : kInfinite;
    const double after = j + 1 < rings_ ? ring_z_mm_[k + 1] - ring_z_mm_[k] : kInfinite;
    ring_pitch_mm_.push_back(std::min(before, after));
  }
  usual_radius_mm_.resize(ring_radius_mm_.size());
  pairs_.resize(static_cast<size_t>(max_chain_ * max_chain_));
  states_.resize(static_cast<size_t>((rings_ + 1) * (max_chain_ + 1) * (max_chain_ + 1)));
  for (auto& labels : labels_) labels.assign(static_cast<size_t>(rings_), -1);
  bends_mm_.resize(static_cast<size_t>(rings_));
  known_.resize(static_cast<size_t>(rings_));
  doubtful_.resize(static_cast<size_t>(rings_));
  counted_.resize(static_cast<size_t>(rings_));
}

RingNumbering::State& RingNumbering::At(int ring, int top, int bottom) {
  return states_[static_cast<size_t>((ring * (max_chain_ + 1) + top) * (max_chain_ + 1) + bottom)];
}

void RingNumbering::Number(std::span<const SightRay> top, std::span<const SightRay> bottom,
                           std::span<const double> around_mm) {
  usual_radius_mm_ = ring_radius_mm_;
  for (size_t k = 0; k < around_mm.size(); ++k) usual_radius_mm_[k] += around_mm[k];
  // Too many: the far ones are the doubtful ones, they are last in the top chain and first in the bottom one.
  const auto most = static_cast<size_t>(max_chain_);
  const size_t skipped = bottom.size() > most ? bottom.size() - most : 0;
  chains_ = {top.first(std::min(top.size(), most)), bottom.subspan(skipped)};
  for (auto& labels : labels_) std::fill(labels.begin(), labels.end(), -1);
  MeetAll();
  if (!AlignPlainly()) {
    Align();
    ReadBack();
    FindBends();
    DropAmbiguousPairs();
    for (int round = 0; round < 2; ++round) {  // what goes takes its neighbours' support away
      CheckSingles();
      DropUnsupported();
    }
  }
  for (const CameraId id : kBothCameras) DropShortRuns(id);
  CheckSingles();
  if (skipped > 0) {
    for (int& label : labels_[Index(CameraId::kBottom)]) label += label >= 0 ? static_cast<int>(skipped) : 0;
  }
}

void RingNumbering::FindBends() {
  for (int j = 0; j < rings_; ++j) {
    const auto k = static_cast<size_t>(j);
    known_[k] = labels_[0][k] >= 0 && labels_[1][k] >= 0;
    if (known_[k]) bends_mm_[k] = PairOf(labels_[0][k], labels_[1][k]).radius_mm - usual_radius_mm_[k];
  }
}

void RingNumbering::MeetAll() {
  for (size_t t = 0; t < chains_[0].size(); ++t) {
    for (size_t b = 0; b < chains_[1].size(); ++b) {
      Pair& pair = pairs_[t * static_cast<size_t>(max_chain_) + b];
      pair.ring = -1;
      const auto meeting = MeetRays(chains_[0][t], chains_[1][b]);
      if (!meeting || meeting->gap_mm > options_.max_ray_gap_mm) continue;
      pair.z_mm = meeting->point_mm.z();
      pair.radius_mm = meeting->point_mm.head<2>().norm();
      pair.gap_mm = meeting->gap_mm;
      pair.ring = RingAt(pair.z_mm, pair.radius_mm);
    }
  }
}

// The one ring that a triangulated point may be on; -1: none.
int RingNumbering::RingAt(double z_mm, double radius_mm) const {
  const auto after = std::lower_bound(ring_z_mm_.begin(), ring_z_mm_.end(), z_mm);
  auto k = static_cast<size_t>(after - ring_z_mm_.begin());
  if (k == ring_z_mm_.size() || (k > 0 && z_mm - ring_z_mm_[k - 1] < ring_z_mm_[k] - z_mm)) --k;
  const bool fits = std::abs(z_mm - ring_z_mm_[k]) <= options_.max_z_error * ring_pitch_mm_[k] &&
                    radius_mm >= tube_radius_mm_ - 1 &&
                    radius_mm <= ring_radius_mm_[k] + options_.max_outward_mm;
  return fits ? static_cast<int>(k) : -1;
}

double RingNumbering::PairCost(const Pair& pair, int ring) const {
  const auto k = static_cast<size_t>(ring);
  const double off_z = (pair.z_mm - ring_z_mm_[k]) / (options_.sigma_z * ring_pitch_mm_[k]);
  return Square(off_z) + Square(pair.gap_mm / options_.sigma_gap_mm);
}

// Capped in the displacement: a dent may be as deep as it likes.
double RingNumbering::RivalCost(const Pair& pair, int ring) const {
  const double bend = pair.radius_mm - usual_radius_mm_[static_cast<size_t>(ring)];
  return PairCost(pair, ring) +
         std::min(Square((bend - ExpectedBend(ring)) / options_.sigma_rival_mm), options_.max_rival_cost);
}

// Both cameras' labels slipped by one, in opposite ways, meet at the right z: a dent or a bulge that is none.
// Where neither's are counted from its end without a gap, the usual radius is a rival.
double RingNumbering::RivalCost(const Pair& pair, int ring, bool counted) const {
  const double cost = RivalCost(pair, ring);
  if (counted) return cost;
  const double bend = pair.radius_mm - usual_radius_mm_[static_cast<size_t>(ring)];
  return std::min(cost, PairCost(pair, ring) + Square(bend / options_.sigma_rest_mm));
}

void RingNumbering::Count() {
  const auto skipped = rings_ - static_cast<int>(chains_[1].size());
  bool top = true, bottom = true;
  std::fill(counted_.begin(), counted_.end(), uint8_t{0});
  for (int j = 0; j < rings_; ++j) {
    const auto near = static_cast<size_t>(j), far = static_cast<size_t>(rings_ - 1 - j);
    top = top && labels_[0][near] == j;
    bottom = bottom && labels_[1][far] + skipped == rings_ - 1 - j;
    if (top) counted_[near] = 1;
    if (bottom) counted_[far] = 1;
  }
}

// A detection that meets one of the other camera's almost as well on some ring may be that ring's; so may
// another pair on the same ring.
void RingNumbering::DropAmbiguousPairs() {
  const auto tops = static_cast<int>(chains_[0].size()), bottoms = static_cast<int>(chains_[1].size());
  std::fill(doubtful_.begin(), doubtful_.end(), uint8_t{0});
  Count();
  for (int j = 0; j < rings_; ++j) {
    const auto k = static_cast<size_t>(j);
    const int t = labels_[0][k], b = labels_[1][k];
    if (t < 0 || b < 0) continue;
    const double limit = RivalCost(PairOf(t, b), j) + options_.min_margin;
    for (int t2 = 0; t2 < tops; ++t2) {
      for (int b2 = 0; b2 < bottoms; ++b2) {
        const Pair& pair = PairOf(t2, b2);
        const bool rival = (t2 == t) != (b2 == b) || (pair.ring == j && t2 != t);
        if (!rival || pair.ring < 0 || RivalCost(pair, pair.ring, counted_[k] != 0) >= limit) continue;
        if (b2 != b) doubtful_[k] |= 1;
        if (t2 != t) doubtful_[k] |= 2;
      }
    }
  }
  for (size_t k = 0; k < doubtful_.size(); ++k) {
    if ((doubtful_[k] & 1) != 0) labels_[0][k] = -1;
    if ((doubtful_[k] & 2) != 0) labels_[1][k] = -1;
  }
}

bool RingNumbering::HasNeighbour(CameraId id, int ring) const {
  const int place = LabelOf(id, ring);
  for (const int step : {-1, 1}) {
    const int next = ring + step;
    if (next >= 0 && next < rings_ && LabelOf(id, next) >= 0 && LabelOf(id, next) == place + step)
      return true;
  }
  return false;
}

// A chance meeting of two rays must not be alone. Next to rings that nothing is known of the far camera's
// label goes, in the middle of such rings both; and so does every label without a neighbour on the skin that
// is its neighbour in the chain, too.
void RingNumbering::DropUnsupported() {
  const auto unresolved = [&](int ring) {
    return ring >= 0 && ring < rings_ && labels_[0][static_cast<size_t>(ring)] < 0 &&
           labels_[1][static_cast<size_t>(ring)] < 0;
  };
  for (int j = 0; j < rings_; ++j) doubtful_[static_cast<size_t>(j)] = 0;
  for (int j = 0; j < rings_; ++j) {
    const auto k = static_cast<size_t>(j);
    if (labels_[0][k] < 0 || labels_[1][k] < 0) continue;
    const bool before = unresolved(j - 1), after = unresolved(j + 1);
    const bool top_is_far = ring_z_mm_[k] > 0.5 * length_mm_;
    if (before && after) doubtful_[k] = 3;
    if (before != after) doubtful_[k] = top_is_far ? 1 : 2;
    if (!HasNeighbour(CameraId::kTop, j)) doubtful_[k] |= 1;
    if (!HasNeighbour(CameraId::kBottom, j)) doubtful_[k] |= 2;
  }
  for (size_t k = 0; k < doubtful_.size(); ++k) {
    if ((doubtful_[k] & 1) != 0) labels_[0][k] = -1;
    if ((doubtful_[k] & 2) != 0) labels_[1][k] = -1;
  }
}

// Runs of rings without more than one missing between them, from the camera's end; the first one is sure.
void RingNumbering::DropShortRuns(CameraId id) {
  auto& labels = labels_[Index(id)];
  const auto ring_at = [&](int i) { return static_cast<size_t>(id == CameraId::kTop ? i : rings_ - 1 - i); };
  int begin = 0, count = 0, missing = 0;
  bool first = true;
  for (int i = 0; i <= rings_; ++i) {
    const bool end = i == rings_;
    if (!end && labels[ring_at(i)] >= 0) {
      if (count == 0) begin = i;
      ++count;
      missing = 0;
      continue;
    }
    ++missing;
    if (count == 0) first = first && i == 0;
    if (count == 0 || (missing < 2 && !end)) continue;
    if (!first && count < options_.min_run) {
      for (int k = begin; k < i; ++k) labels[ring_at(k)] = -1;
    }
    first = false;
    count = 0;
  }
}

std::optional<double> RingNumbering::Bend(CameraId id, int place, int ring) const {
  if (ring < 0 || ring >= rings_) return std::nullopt;
  const auto k = static_cast<size_t>(ring);
  const auto point = chains_[Index(id)][static_cast<size_t>(place)].AtZ(ring_z_mm_[k]);
  if (!point) return std::nullopt;
  const double radius = point->head<2>().norm();
  if (radius < tube_radius_mm_ - 1 || radius > ring_radius_mm_[k] + options_.max_outward_mm)
    return std::nullopt;
  return radius - usual_radius_mm_[k];
}

// As the thesis numbers, by counting; believed if nothing is missing and every ring agrees.
bool RingNumbering::AlignPlainly() {
  const auto full = static_cast<size_t>(rings_);
  if (chains_[0].size() != full || chains_[1].size() != full) return false;
  for (int j = 0; j < rings_; ++j) {
    if (PairOf(j, j).ring != j) return false;
  }
  for (auto& labels : labels_) std::iota(labels.begin(), labels.end(), 0);
  return true;
}

void RingNumbering::Align() {
  const auto tops = static_cast<int>(chains_[0].size()), bottoms = static_cast<int>(chains_[1].size());
  for (int j = 0; j <= rings_; ++j) {
    for (int t = 0; t <= tops; ++t) {
      for (int b = 0; b <= bottoms; ++b) At(j, t, b).cost = kInfinite;
    }
  }
  At(0, 0, 0) = {};
  const auto lag_top = std::max(kMaxLag, rings_ - tops), lag_bottom = std::max(kMaxLag, rings_ - bottoms);
  for (int j = 0; j <= rings_; ++j) {
    for (int t = std::max(0, j - lag_top); t <= std::min(tops, j + kSpare); ++t) {
      for (int b = std::max(0, j - lag_bottom); b <= std::min(bottoms, j + kSpare); ++b) {
        if (At(j, t, b).cost < kInfinite) Relax(j, t, b);
      }
    }
  }
}

void RingNumbering::Offer(int ring, int top, int bottom, double cost, double bend_mm, Move move) {
  State& state = At(ring, top, bottom);
  if (cost < state.cost) state = {cost, bend_mm, move};
}

void RingNumbering::Relax(int ring, int top, int bottom) {
  const State from = At(ring, top, bottom);
  const bool has_top = top < static_cast<int>(chains_[0].size());
  const bool has_bottom = bottom < static_cast<int>(chains_[1].size());
  if (has_top) Offer(ring, top + 1, bottom, from.cost + options_.false_cost, from.bend_mm, kFalseTop);
  if (has_bottom) Offer(ring, top, bottom + 1, from.cost + options_.false_cost, from.bend_mm, kFalseBottom);
  if (ring == rings_) return;
  const auto k = static_cast<size_t>(ring);
  Offer(ring + 1, top, bottom, from.cost + 2 * options_.miss_cost, from.bend_mm, kNone);
  const auto bending = [&](double bend_mm) {
    return Square((bend_mm - from.bend_mm) / options_.sigma_bend_mm);
  };
  if (has_top) {
    if (const auto bend = Bend(CameraId::kTop, top, ring))
      Offer(ring + 1, top + 1, bottom, from.cost + options_.miss_cost + bending(*bend), *bend, kTopOnly);
  }
  if (has_bottom) {
    if (const auto bend = Bend(CameraId::kBottom, bottom, ring))
      Offer(ring + 1, top, bottom + 1, from.cost + options_.miss_cost + bending(*bend), *bend, kBottomOnly);
  }
  if (has_top && has_bottom) {
    const Pair& pair = PairOf(top, bottom);
    if (pair.ring != ring) return;
    const double bend = pair.radius_mm - usual_radius_mm_[k];
    Offer(ring + 1, top + 1, bottom + 1, from.cost + PairCost(pair, ring) + bending(bend), bend, kPair);
  }
}

void RingNumbering::ReadBack() {
  int j = rings_, t = static_cast<int>(chains_[0].size()), b = static_cast<int>(chains_[1].size());
  while (j > 0 || t > 0 || b > 0) {
    const Move move = At(j, t, b).move;
    if (move == kFalseTop) {
      --t;
      continue;
    }
    if (move == kFalseBottom) {
      --b;
      continue;
    }
    if (move == kStart) return;
    --j;
    if (move == kTopOnly || move == kPair) labels_[0][static_cast<size_t>(j)] = --t;
    if (move == kBottomOnly || move == kPair) labels_[1][static_cast<size_t>(j)] = --b;
  }
}

// On the line between the nearest rings that are known; the clamped ends always are.
double RingNumbering::ExpectedBend(int ring) const {
  double z0 = 0, bend0 = 0, z1 = length_mm_, bend1 = 0;
  for (int j = ring - 1; j >= 0; --j) {
    const auto k = static_cast<size_t>(j);
    if (!known_[k]) continue;
    z0 = ring_z_mm_[k], bend0 = bends_mm_[k];
    break;
  }
  for (int j = ring + 1; j < rings_; ++j) {
    const auto k = static_cast<size_t>(j);
    if (!known_[k]) continue;
    z1 = ring_z_mm_[k], bend1 = bends_mm_[k];
    break;
  }
  return bend0 + (bend1 - bend0) * (ring_z_mm_[static_cast<size_t>(ring)] - z0) / (z1 - z0);
}

// Without the other camera only the order tells rings apart: the neighbour in the chain towards the camera
// must be that on the skin, and the radial displacement must suit this ring better than the next ones.
bool RingNumbering::SingleHolds(CameraId id, int ring, double expected_mm) const {
  const auto& labels = labels_[Index(id)];
  const int place = labels[static_cast<size_t>(ring)];
  const int step = id == CameraId::kTop ? -1 : 1;  // towards the camera
  const int next_place = place + step, next_ring = ring + step;
  const bool last_ring = next_ring < 0 || next_ring >= rings_;
  const bool last_place = next_place < 0 || next_place >= static_cast<int>(chains_[Index(id)].size());
  if (last_ring != last_place) return false;
  if (!last_ring && labels[static_cast<size_t>(next_ring)] != next_place) return false;
  // Nor may it meet a ray of the other camera well on another ring.
  for (int other = 0; other < static_cast<int>(chains_[1 - Index(id)].size()); ++other) {
    const Pair& pair = id == CameraId::kTop ? PairOf(place, other) : PairOf(other, place);
    if (pair.ring >= 0 && pair.ring != ring && RivalCost(pair, pair.ring) < options_.max_rival_cost - 1)
      return false;
  }
  const auto bend = Bend(id, place, ring);
  if (!bend) return false;
  for (const int other : {ring - 1, ring + 1}) {
    const auto alternative = Bend(id, place, other);
    if (alternative &&
        std::abs(*bend - expected_mm) > options_.max_single_error * std::abs(*alternative - *bend))
      return false;
  }
  return true;
}

// Near rings first: there the next ring is far away in the picture, and each one that holds supports the
// next.
void RingNumbering::CheckSingles() {
  FindBends();
  for (int i = 0; i < kCameraCount * rings_; ++i) {
    const CameraId id = i < rings_ ? CameraId::kTop : CameraId::kBottom;
    const int ring = id == CameraId::kTop ? i : kCameraCount * rings_ - 1 - i;
    const auto k = static_cast<size_t>(ring);
    if (labels_[Index(id)][k] < 0 || labels_[1 - Index(id)][k] >= 0) continue;
    if (!SingleHolds(id, ring, ExpectedBend(ring))) {
      labels_[Index(id)][k] = -1;
      continue;
    }
    bends_mm_[k] = *Bend(id, labels_[Index(id)][k], ring);
    known_[k] = true;
  }
}

}  // namespace taclink
