#include "sensing/markers/label/chain_alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

}  // namespace

void ChainAlignment::Start(int spots, const std::vector<double>& ring_z_mm, double length_mm,
                           const std::vector<double>& missing_cost) {
  spot_count_ = spots;
  ring_count_ = static_cast<int>(ring_z_mm.size());
  ring_z_mm_ = ring_z_mm;
  length_mm_ = length_mm;
  missing_sums_.assign(1, 0);
  for (const double cost : missing_cost) missing_sums_.push_back(missing_sums_.back() + cost);
  states_.assign(static_cast<size_t>(spot_count_ * ring_count_), {});
}

void ChainAlignment::Allow(int spot, int ring, double cost, double displacement_mm) {
  At(spot, ring) = {true, cost, displacement_mm, 0, 0};
}

double ChainAlignment::StepCost(double dz_mm, double change_mm) const {
  const double steps = change_mm / (options_.sigma_slope * dz_mm);
  return std::min(steps * steps, options_.max_cost);
}

// Of the rings and spots that are skipped between two that are used.
double ChainAlignment::GapCost(int spot_before, int ring_before, int spot_after, int ring_after) const {
  return missing_sums_[static_cast<size_t>(ring_after)] -
         missing_sums_[static_cast<size_t>(ring_before + 1)] +
         options_.false_cost * (spot_after - spot_before - 1);
}

template <typename Visit>
void ChainAlignment::ForEachNext(int spot, int ring, Visit visit) {
  const int last_spot = std::min(spot_count_ - 1, spot + 1 + options_.max_false);
  const int last_ring = std::min(ring_count_ - 1, ring + 1 + options_.max_missing);
  const State& from = At(spot, ring);
  for (int k = spot + 1; k <= last_spot; ++k) {
    for (int j = ring + 1; j <= last_ring; ++j) {
      State& to = At(k, j);
      if (!to.allowed) continue;
      const double dz = ring_z_mm_[static_cast<size_t>(j)] - ring_z_mm_[static_cast<size_t>(ring)];
      visit(k, j, to, GapCost(spot, ring, k, j) + StepCost(dz, to.displacement_mm - from.displacement_mm));
    }
  }
}

void ChainAlignment::Forward() {
  for (int k = 0; k < spot_count_; ++k) {
    for (int j = 0; j < ring_count_; ++j) {
      State& state = At(k, j);
      state.forward = GapCost(-1, -1, k, j) +
                      StepCost(ring_z_mm_[static_cast<size_t>(j)], state.displacement_mm) + state.cost;
    }
  }
  for (int k = 0; k < spot_count_; ++k) {
    for (int j = 0; j < ring_count_; ++j) {
      const State& from = At(k, j);
      if (!from.allowed) continue;
      ForEachNext(k, j, [&](int, int, State& to, double cost) {
        to.forward = std::min(to.forward, from.forward + cost + to.cost);
      });
    }
  }
}

void ChainAlignment::Backward() {
  for (int k = spot_count_ - 1; k >= 0; --k) {
    for (int j = ring_count_ - 1; j >= 0; --j) {
      State& from = At(k, j);
      if (!from.allowed) continue;
      from.backward = GapCost(k, j, spot_count_, ring_count_) +
                      StepCost(length_mm_ - ring_z_mm_[static_cast<size_t>(j)], from.displacement_mm);
      ForEachNext(k, j, [&](int, int, const State& to, double cost) {
        from.backward = std::min(from.backward, cost + to.cost + to.backward);
      });
    }
  }
}

void ChainAlignment::FindMargins() {
  const double none = GapCost(-1, -1, spot_count_, ring_count_);
  without_.assign(static_cast<size_t>(spot_count_), none);
  const auto skip = [&](int after, int before, double total) {
    for (int k = after + 1; k < before; ++k) {
      without_[static_cast<size_t>(k)] = std::min(without_[static_cast<size_t>(k)], total);
    }
  };
  for (int k = 0; k < spot_count_; ++k) {
    for (int j = 0; j < ring_count_; ++j) {
      const State& from = At(k, j);
      if (!from.allowed) continue;
      const auto z = ring_z_mm_[static_cast<size_t>(j)];
      skip(-1, k, GapCost(-1, -1, k, j) + StepCost(z, from.displacement_mm) + from.cost + from.backward);
      skip(k, spot_count_,
           from.forward + GapCost(k, j, spot_count_, ring_count_) +
               StepCost(length_mm_ - z, from.displacement_mm));
      ForEachNext(k, j, [&](int next, int, const State& to, double cost) {
        if (next > k + 1) skip(k, next, from.forward + cost + to.cost + to.backward);
      });
    }
  }
  for (int k = 0; k < spot_count_; ++k) {
    double best = without_[static_cast<size_t>(k)], second = kInfinite;
    int& ring = rings_of_[static_cast<size_t>(k)];
    for (int j = 0; j < ring_count_; ++j) {
      const State& state = At(k, j);
      if (!state.allowed) continue;
      const double total = state.forward + state.backward;
      if (total < best) {
        second = best;
        best = total;
        ring = j;
      } else {
        second = std::min(second, total);
      }
    }
    margins_[static_cast<size_t>(k)] = ring < 0 ? 0 : second - best;
  }
}

void ChainAlignment::Solve() {
  rings_of_.assign(static_cast<size_t>(spot_count_), -1);
  margins_.assign(static_cast<size_t>(spot_count_), 0);
  Forward();
  Backward();
  FindMargins();
}

}  // namespace taclink
