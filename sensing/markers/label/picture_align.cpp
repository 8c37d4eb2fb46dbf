// PictureLabeller: which ring each spot of a path is.

#include <algorithm>
#include <cmath>

#include "sensing/markers/label/picture_labeller.h"

namespace taclink {
namespace {

constexpr double kSigmaOffPath = 0.12;  // path pitches
constexpr double kSigmaLogArea = 0.7;
constexpr double kMissingCost = 5, kMissingOutsideCost = 0.5;  // a ring is not seen; is outside the picture
constexpr double kMinMargin = 3;                               // to the second best alignment
// What is pushed goes inwards: outwards the skin moves only as a whole, which the grid's rings take up, and a
// little beside a dent. Neighbouring spots err alike, so that each counts for less than one.
constexpr double kFreeOutwardMm = 2, kSigmaOutwardMm = 1.5, kMaxOutwardCost = 2;
constexpr double kSpotWeight = 0.4;
// Displacements of neighbouring paths, in what the next ring's label would be off.
constexpr double kAgreeing = 0.35, kAgreeingOneSided = 0.25, kSpread = 0.5;
constexpr double kInDentMm = 1.5;
// A dent that goes deeper than the neighbours by more than this (mm and times) is none.
constexpr double kMaxBeyondMm = 3, kMaxBeyondTimes = 3, kMaxOutwardBeyondMm = 2;
// The neighbours' displacement as a prior. Its standard deviation grows with what they have beyond kAtRestMm.
constexpr double kSigmaRestMm = 0.7, kSigmaPart = 2, kMaxPriorCost = 8;
constexpr double kSigmaOneSidedMm = 0.5, kMaxRestMm = 3;

}  // namespace

// From the neighbouring paths. None: nothing is known of them, or they are deformed.
std::optional<PictureLabeller::Expected> PictureLabeller::FromNeighbours(int path, int ring) {
  double sum = 0, largest = 0;
  int sides = 0;
  for (const int side : {-1, 1}) {
    if (!Has(path + side, ring)) continue;
    sum += At(path + side, ring).displacement_mm;
    ++sides;
    for (const int j : {ring - 1, ring, ring + 1}) {
      if (Has(path + side, j)) largest = std::max(largest, std::abs(At(path + side, j).displacement_mm));
    }
  }
  if (sides == 0 || largest > kMaxRestMm) return std::nullopt;  // in a dent only counting is sure
  return Expected{sum / sides, kSigmaRestMm + kSigmaPart * std::max(0.0, largest - kAtRestMm) +
                                   (sides == 1 ? kSigmaOneSidedMm : 0)};
}

double PictureLabeller::CostOf(const Spot& spot, int ring, double displacement_mm,
                               const std::optional<Expected>& expected) {
  const Detection& d = detections_[static_cast<size_t>(spot.detection)];
  double cost = std::pow(spot.off_path / kSigmaOffPath, 2);
  if (!d.clipped) {
    const double off = (std::log(d.area_px2) - log_areas_[static_cast<size_t>(ring)]) / kSigmaLogArea;
    cost += std::min(off * off, 6.0);
  }
  const double outward = std::max(0.0, -displacement_mm - kFreeOutwardMm) / kSigmaOutwardMm;
  cost += kSpotWeight * std::min(outward * outward, kMaxOutwardCost);
  if (expected) {
    const double off = (displacement_mm - expected->displacement_mm) / expected->sigma_mm;
    cost += kSpotWeight * std::min(off * off, kMaxPriorCost);
  }
  return cost;
}

void PictureLabeller::AlignPath(int path) {
  auto& spots = spots_[static_cast<size_t>(path)];
  std::vector<double> missing;
  for (int j = 0; j < rings_; ++j) {
    const Vec2 p = grid_.PixelOf(path, 0, grid_.ring_log_radii()[static_cast<size_t>(j)]);
    const double size = std::exp(0.5 * log_areas_[static_cast<size_t>(j)]);
    missing.push_back(Inside(p, 0.5 * size) ? kMissingCost : kMissingOutsideCost);
  }
  alignment_.Start(static_cast<int>(spots.size()), along_mm_, model_.length_mm, missing);
  for (int j = 0; j < rings_; ++j) {
    const auto expected = FromNeighbours(path, j);
    for (size_t k = 0; k < spots.size(); ++k) {
      const double displacement = DisplacementOf(spots[k].tan, j);
      if (!Possible(displacement, j)) continue;
      alignment_.Allow(static_cast<int>(k), j, CostOf(spots[k], j, displacement, expected), displacement);
    }
  }
  alignment_.Solve();
  for (size_t k = 0; k < spots.size(); ++k) {
    const bool sure = alignment_.MarginOf(static_cast<int>(k)) >= kMinMargin;
    spots[k].ring = sure ? alignment_.RingOf(static_cast<int>(k)) : -1;
  }
}

// All paths at once, so that their order does not matter.
void PictureLabeller::TakeLabels() {
  for (Cell& cell : cells_) cell = {};
  for (int l = 0; l < paths_; ++l) {
    for (const Spot& spot : spots_[static_cast<size_t>(l)]) {
      if (spot.ring < 0) continue;
      At(l, spot.ring) = {detections_[static_cast<size_t>(spot.detection)], spot.off_path, spot.log_radius,
                          DisplacementOf(spot.tan, spot.ring), static_cast<size_t>(spot.detection) >= given_};
    }
  }
  DropImplausible();
  labelled_ = 0;
  for (const Cell& cell : cells_) labelled_ += cell.detection ? 1 : 0;
}

// Skin is continuous: what both neighbouring paths say bounds what is between them.
void PictureLabeller::DropImplausible() {
  std::vector<size_t> dropped;
  for (int l = 0; l < paths_; ++l) {
    for (int j = 0; j < rings_; ++j) {
      if (!Has(l, j) || !Has(l - 1, j) || !Has(l + 1, j)) continue;
      const double u = At(l, j).displacement_mm;
      const double a = At(l - 1, j).displacement_mm, b = At(l + 1, j).displacement_mm;
      const bool in = u > kMaxBeyondMm + kMaxBeyondTimes * std::max({a, b, 0.0});
      const bool out = u < std::min({a, b, 0.0}) - kMaxOutwardBeyondMm;
      if (in || out) dropped.push_back(static_cast<size_t>(l * rings_ + j));
    }
  }
  for (const size_t index : dropped) cells_[index] = {};
}

// By how much the displacement would be off with the next ring's label.
double PictureLabeller::PitchMm(int ring) const {
  const int next = ring + 1 < rings_ ? ring + 1 : ring - 1;
  const auto j = static_cast<size_t>(ring), k = static_cast<size_t>(next);
  return grid_.ring_radius_mm(ring) * std::abs(along_mm_[k] - along_mm_[j]) / grid_.ring_distance_mm(ring);
}

// Counting from the rim is sure up to the first ring that is missing, spot that is left over, or spot that
// only the search along the path found; but where that is cannot be told within a dent.
void PictureLabeller::CountFromRim(int path, std::vector<bool>& sure) {
  const auto& spots = spots_[static_cast<size_t>(path)];
  int counted = 0;
  for (const Spot& spot : spots) {
    const bool found_later = static_cast<size_t>(spot.detection) >= given_;
    if (spot.ring != counted || found_later || !Has(path, counted)) break;
    ++counted;
  }
  if (counted < rings_) {
    while (counted > 0 && std::abs(At(path, counted - 1).displacement_mm) > kInDentMm) --counted;
    counted = std::max(0, counted - 1);
  }
  for (int j = 0; j < counted; ++j) sure[static_cast<size_t>(path * rings_ + j)] = true;
}

// What is beyond that has to agree with sure neighbours, to a part of what the next ring's label would be
// off.
bool PictureLabeller::NeighboursAgree(int path, int ring, const std::vector<bool>& sure) {
  const double u = At(path, ring).displacement_mm, pitch = PitchMm(ring);
  double sum = 0, least = 1e9, largest = -1e9;
  int sides = 0;
  for (const int l : {(path + paths_ - 1) % paths_, (path + 1) % paths_}) {
    if (!sure[static_cast<size_t>(l * rings_ + ring)]) continue;
    const double other = At(l, ring).displacement_mm;
    sum += other, ++sides;
    least = std::min(least, other), largest = std::max(largest, other);
  }
  if (std::max(largest, -least) > (sides == 2 ? kMaxRestMm : kAtRestMm)) return false;
  if (sides == 2) return std::abs(u - sum / 2) < kAgreeing * pitch && largest - least < kSpread * pitch;
  return sides == 1 && std::abs(u - sum) < kAgreeingOneSided * pitch;
}

void PictureLabeller::DropUnsure() {
  std::vector<bool> sure(cells_.size(), false);
  for (int l = 0; l < paths_; ++l) CountFromRim(l, sure);
  for (bool more = true; more;) {
    std::vector<size_t> agreed;
    for (int l = 0; l < paths_; ++l) {
      for (int j = 0; j < rings_; ++j) {
        const auto index = static_cast<size_t>(l * rings_ + j);
        if (Has(l, j) && !sure[index] && NeighboursAgree(l, j, sure)) agreed.push_back(index);
      }
    }
    for (const size_t index : agreed) sure[index] = true;
    more = !agreed.empty();
  }
  for (size_t i = 0; i < cells_.size(); ++i) {
    if (!sure[i]) cells_[i] = {};
  }
}

}  // namespace taclink
