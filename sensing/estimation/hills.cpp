#include "sensing/estimation/hills.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace taclink {
namespace {

constexpr double kSmoothMm = 7;
constexpr double kLeastHeight = 0.02, kLeastHeightN = 1e-4;  // of the highest; below there is no hill
constexpr double kWatershedSaddle = 0.9;                     // of the lower peak: one hill
constexpr double kOpposed = 0.93;            // of the sum of the forces' sizes: no single contact
constexpr double kFarMm = 65, kNearMm = 22;  // between peaks
constexpr double kFlatMm = 0.5;              // of bulge beyond the chord: one body can lie there
constexpr double kLowSaddle = 0.1, kHighSaddle = 0.75;

Vec3 OuterPoint(const SkinMechanics& mechanics, const Linearization& skin, int site) {
  return skin.state().AtOffset(mechanics.NodeOfSite(site), mechanics.model().thickness_mm / 2);
}

}  // namespace

std::vector<int> HillFinder::AllOf(const std::vector<Hill>& hills) {
  std::vector<int> sites;
  for (const Hill& hill : hills) sites.insert(sites.end(), hill.begin(), hill.end());
  return sites;
}

HillFinder::HillFinder(const SkinMechanics& mechanics) : mechanics_(mechanics) {}

void HillFinder::Smooth(const Eigen::VectorXd& loads_n, std::span<const int> support) {
  const double width = kSmoothMm * mechanics_.length_unit();
  height_.setZero(mechanics_.site_count());
  for (const int from : support) {
    for (int site = 0; site < mechanics_.site_count(); ++site) {
      const double off2 = (mechanics_.RestSite(site) - mechanics_.RestSite(from)).squaredNorm();
      height_[site] += loads_n[from] * std::exp(-off2 / (2 * width * width));
    }
  }
}

int HillFinder::Root(int basin) const {
  while (parent_[static_cast<size_t>(basin)] != basin) basin = parent_[static_cast<size_t>(basin)];
  return basin;
}

template <typename Visit>
void HillFinder::ForNeighbors(int site, Visit visit) const {
  const int columns = mechanics_.columns(), row = site / columns, column = site % columns;
  for (int r = std::max(0, row - 1); r <= std::min(mechanics_.site_rows() - 1, row + 1); ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      const int next = r * columns + (c + columns) % columns;
      if (next != site) visit(next);
    }
  }
}

// From the highest site down; a site joins the basin of its highest neighbor.
void HillFinder::Flood(const Linearization& skin, const Eigen::VectorXd& loads_n) {
  order_.resize(static_cast<size_t>(mechanics_.site_count()));
  std::iota(order_.begin(), order_.end(), 0);
  std::sort(order_.begin(), order_.end(), [&](int a, int b) { return height_[a] > height_[b]; });
  basin_.assign(order_.size(), -1);
  parent_.clear();
  peak_.clear();
  mass_.clear();
  sum_.clear();
  const double least = std::min(kLeastHeight * height_.maxCoeff(), kLeastHeightN * mechanics_.force_unit());
  std::vector<int> around;
  for (const int site : order_) {
    if (height_[site] < least) break;
    around.clear();
    ForNeighbors(site, [&](int next) {
      if (const int basin = basin_[static_cast<size_t>(next)]; basin >= 0) around.push_back(Root(basin));
    });
    std::sort(around.begin(), around.end(),
              [&](int a, int b) { return peak_[static_cast<size_t>(a)] > peak_[static_cast<size_t>(b)]; });
    around.erase(std::unique(around.begin(), around.end()), around.end());
    const Vec3 force = loads_n[site] * skin.frames()[static_cast<size_t>(site)].col(0);
    if (around.empty()) {
      around.push_back(static_cast<int>(parent_.size()));
      parent_.push_back(around.front());
      peak_.push_back(height_[site]);
      mass_.push_back(0);
      sum_.push_back(Vec3::Zero());
    }
    const auto into = static_cast<size_t>(around.front());
    basin_[static_cast<size_t>(site)] = around.front();
    mass_[into] += loads_n[site];
    sum_[into] += force;
    for (size_t k = 1; k < around.size(); ++k) {
      const auto other = static_cast<size_t>(around[k]);
      if (other == into || height_[site] <= kWatershedSaddle * peak_[other]) continue;
      if ((sum_[other] + sum_[into]).norm() < kOpposed * (mass_[other] + mass_[into])) continue;
      parent_[other] = static_cast<int>(into);
      mass_[into] += mass_[other];
      sum_[into] += sum_[other];
    }
  }
}

int HillFinder::PeakOf(const Hill& hill) const {
  return *std::max_element(hill.begin(), hill.end(), [&](int a, int b) { return height_[a] < height_[b]; });
}

// Along the straight line of the grid between two sites: how far the outer wall comes out beyond the chord,
// and the lowest height.
HillFinder::Ridge HillFinder::Between(const Linearization& skin, int a, int b) const {
  const int columns = mechanics_.columns(), rows = mechanics_.site_rows();
  const int row = a / columns, column = a % columns;
  const int down = b / columns - row;
  const int across = (b % columns - column + columns + columns / 2) % columns - columns / 2;
  const int parts = std::max(std::abs(down), std::abs(across));
  const Vec3 from = OuterPoint(mechanics_, skin, a), to = OuterPoint(mechanics_, skin, b);
  const Vec3 outward =
      -(skin.frames()[static_cast<size_t>(a)].col(0) + skin.frames()[static_cast<size_t>(b)].col(0))
           .normalized();
  Ridge ridge{.bulge_mm = -1e9, .saddle = parts > 1 ? 1e9 : std::min(height_[a], height_[b])};
  for (int k = 1; k < parts; ++k) {
    const double share = static_cast<double>(k) / parts, r = row + share * down, c = column + share * across;
    const int r0 = std::clamp(static_cast<int>(std::floor(r)), 0, rows - 2);
    const int c0 = static_cast<int>(std::floor(c));
    const double u = r - r0, w = c - c0;
    Vec3 point = Vec3::Zero();
    double height = 0;
    for (int i = 0; i < 4; ++i) {
      const double weight = (i / 2 == 0 ? 1 - u : u) * (i % 2 == 0 ? 1 - w : w);
      const int site = (r0 + i / 2) * columns + ((c0 + i % 2) % columns + columns) % columns;
      point += weight * OuterPoint(mechanics_, skin, site);
      height += weight * height_[site];
    }
    ridge.bulge_mm = std::max(ridge.bulge_mm, (point - (1 - share) * from - share * to).dot(outward));
    ridge.saddle = std::min(ridge.saddle, height);
  }
  ridge.saddle /= std::min(height_[a], height_[b]);
  return ridge;
}

bool HillFinder::MayJoin(const Linearization& skin, const Eigen::VectorXd& loads_n, const Hill& a,
                         const Hill& b, double& distance_mm) const {
  const double unit = mechanics_.length_unit();
  const int top_a = PeakOf(a), top_b = PeakOf(b);
  distance_mm = (OuterPoint(mechanics_, skin, top_a) - OuterPoint(mechanics_, skin, top_b)).norm();
  if (distance_mm > kFarMm * unit) return false;
  Vec3 sum = Vec3::Zero();
  double mass = 0;
  for (const Hill* hill : {&a, &b}) {
    for (const int site : *hill) {
      sum += loads_n[site] * skin.frames()[static_cast<size_t>(site)].col(0);
      mass += loads_n[site];
    }
  }
  if (sum.norm() < kOpposed * mass) return false;
  const Ridge ridge = Between(skin, top_a, top_b);
  if (ridge.saddle > kHighSaddle) return true;
  const bool one_body = ridge.bulge_mm < kFlatMm * unit || distance_mm < kNearMm * unit;
  return one_body && ridge.saddle > kLowSaddle;
}

std::vector<HillFinder::Hill> HillFinder::Find(const Linearization& skin, const Eigen::VectorXd& loads_n,
                                               std::span<const int> support) {
  if (support.empty()) return {};
  Smooth(loads_n, support);
  Flood(skin, loads_n);
  std::vector<Hill> by_root(parent_.size());
  for (const int site : support) {
    if (const int basin = basin_[static_cast<size_t>(site)]; basin >= 0)
      by_root[static_cast<size_t>(Root(basin))].push_back(site);
  }
  std::vector<Hill> hills;
  for (Hill& hill : by_root) {
    if (!hill.empty()) hills.push_back(std::move(hill));
  }
  // The nearest two that are one body first.
  while (hills.size() > 1) {
    double nearest = 1e9;
    size_t first = 0, second = 0;
    for (size_t i = 1; i < hills.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        double distance = 0;
        if (!MayJoin(skin, loads_n, hills[i], hills[j], distance) || distance >= nearest) continue;
        nearest = distance;
        first = j;
        second = i;
      }
    }
    if (second == 0) break;
    hills[first].insert(hills[first].end(), hills[second].begin(), hills[second].end());
    hills.erase(hills.begin() + static_cast<std::ptrdiff_t>(second));
  }
  return hills;
}

}  // namespace taclink
