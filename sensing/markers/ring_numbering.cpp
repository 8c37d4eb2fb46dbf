#include "sensing/markers/ring_numbering.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr int kSpare = 4;  // detections of a path beyond its rings that are looked at

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
  pairs_.resize(static_cast<size_t>(max_chain_ * max_chain_));
  states_.resize(static_cast<size_t>((rings_ + 1) * (max_chain_ + 1) * (max_chain_ + 1)));
  for (auto& labels : labels_) labels.assign(static_cast<size_t>(rings_), -1);
  bends_mm_.resize(static_cast<size_t>(rings_));
  known_.resize(static_cast<size_t>(rings_));
}

RingNumbering::State& RingNumbering::At(int ring, int top, int bottom) {
  return states_[static_cast<size_t>((ring * (max_chain_ + 1) + top) * (max_chain_ + 1) + bottom)];
}

void RingNumbering::Number(std::span<const SightRay> top, std::span<const SightRay> bottom) {
  // Too many: the far ones are the doubtful ones, they are last in the top chain and first in the bottom one.
  const auto most = static_cast<size_t>(max_chain_);
  const size_t skipped = bottom.size() > most ? bottom.size() - most : 0;
  chains_ = {top.first(std::min(top.size(), most)), bottom.subspan(skipped)};
  for (auto& labels : labels_) std::fill(labels.begin(), labels.end(), -1);
  MeetAll();
  if (!AlignPlainly()) {
    Align();
    ReadBack();
  }
  std::fill(known_.begin(), known_.end(), false);
  for (int j = 0; j < rings_; ++j) {
    const auto k = static_cast<size_t>(j);
    if (labels_[0][k] < 0 || labels_[1][k] < 0) continue;
    bends_mm_[k] = PairOf(labels_[0][k], labels_[1][k]).radius_mm - ring_radius_mm_[k];
    known_[k] = true;
  }
  for (const CameraId id : kBothCameras) CheckSingles(id);
  if (skipped > 0) {
    for (int& label : labels_[Index(CameraId::kBottom)]) label += label >= 0 ? static_cast<int>(skipped) : 0;
  }
}

void RingNumbering::MeetAll() {
  for (size_t t = 0; t < chains_[0].size(); ++t) {
    for (size_t b = 0; b < chains_[1].size(); ++b) {
      Pair& pair = pairs_[t * static_cast<size_t>(max_chain_) + b];
      const auto meeting = MeetRays(chains_[0][t], chains_[1][b]);
      pair.possible = meeting && meeting->gap_mm <= options_.max_ray_gap_mm;
      if (!pair.possible) continue;
      pair.z_mm = meeting->point_mm.z();
      pair.radius_mm = meeting->point_mm.head<2>().norm();
      pair.gap_mm = meeting->gap_mm;
    }
  }
}

bool RingNumbering::PairFits(const Pair& pair, int ring) const {
  const auto k = static_cast<size_t>(ring);
  return pair.possible && std::abs(pair.z_mm - ring_z_mm_[k]) <= options_.max_z_error * ring_pitch_mm_[k] &&
         pair.radius_mm >= tube_radius_mm_ - 1 &&
         pair.radius_mm <= ring_radius_mm_[k] + options_.max_outward_mm;
}

std::optional<double> RingNumbering::Bend(CameraId id, int place, int ring) const {
  if (ring < 0 || ring >= rings_) return std::nullopt;
  const auto k = static_cast<size_t>(ring);
  const auto point = chains_[Index(id)][static_cast<size_t>(place)].AtZ(ring_z_mm_[k]);
  if (!point) return std::nullopt;
  const double radius = point->head<2>().norm();
  if (radius < tube_radius_mm_ - 1 || radius > ring_radius_mm_[k] + options_.max_outward_mm)
    return std::nullopt;
  return radius - ring_radius_mm_[k];
}

// As the thesis numbers: by counting from each camera's end. Holds nearly always; true if every ring that
// both cameras count agrees, and only far rings are missing.
bool RingNumbering::AlignPlainly() {
  const auto tops = static_cast<int>(chains_[0].size()), bottoms = static_cast<int>(chains_[1].size());
  if (tops > rings_ || bottoms > rings_ || tops + bottoms < rings_ + 2) return false;
  const int first = rings_ - bottoms;  // ring of the bottom chain's first
  if (first < 0) return false;
  for (int j = first; j < tops; ++j) {
    const Pair& pair = PairOf(j, j - first);
    const auto k = static_cast<size_t>(j);
    const bool close = std::abs(pair.z_mm - ring_z_mm_[k]) <= options_.plain_z_error * ring_pitch_mm_[k];
    if (!PairFits(pair, j) || !close) return false;
  }
  for (int j = 0; j < tops; ++j) labels_[0][static_cast<size_t>(j)] = j;
  for (int j = first; j < rings_; ++j) labels_[1][static_cast<size_t>(j)] = j - first;
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
  for (int j = 0; j <= rings_; ++j) {
    for (int t = 0; t <= tops; ++t) {
      for (int b = 0; b <= bottoms; ++b) {
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
    if (!PairFits(pair, ring)) return;
    const double bend = pair.radius_mm - ring_radius_mm_[k];
    const double off_z = (pair.z_mm - ring_z_mm_[k]) / (options_.sigma_z * ring_pitch_mm_[k]);
    const double cost = Square(off_z) + Square(pair.gap_mm / options_.sigma_gap_mm) + bending(bend);
    Offer(ring + 1, top + 1, bottom + 1, from.cost + cost, bend, kPair);
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

bool RingNumbering::SingleHolds(CameraId id, int ring, double expected_mm) const {
  const int place = labels_[Index(id)][static_cast<size_t>(ring)];
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
void RingNumbering::CheckSingles(CameraId id) {
  const auto other = 1 - Index(id);
  for (int i = 0; i < rings_; ++i) {
    const int ring = id == CameraId::kTop ? i : rings_ - 1 - i;
    const auto k = static_cast<size_t>(ring);
    if (labels_[Index(id)][k] < 0 || labels_[other][k] >= 0) continue;
    if (!SingleHolds(id, ring, ExpectedBend(ring))) {
      labels_[Index(id)][k] = -1;
      continue;
    }
    bends_mm_[k] = *Bend(id, labels_[Index(id)][k], ring);
    known_[k] = true;
  }
}

}  // namespace taclink
