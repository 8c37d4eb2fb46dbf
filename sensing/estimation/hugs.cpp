// Loads all around the skin: the part of LoadEstimator about bands.
#include <algorithm>

#include "sensing/estimation/load_estimator.h"

namespace taclink {
namespace {

constexpr double kMostFree = 0.25;  // of the way around, between the loads of a hug

// Of the way around, the widest stretch without a load.
double WidestFree(const std::vector<char>& is_loaded) {
  const size_t around = is_loaded.size();
  size_t widest = 0, free = 0;
  for (size_t i = 0; i < 2 * around; ++i) {
    free = is_loaded[i % around] != 0 ? 0 : free + 1;
    widest = std::max(widest, free);
  }
  return static_cast<double>(widest) / static_cast<double>(around);
}

}  // namespace

// What sites bear of loads of sites and bands.
void LoadEstimator::ShareBands(const Eigen::VectorXd& inward_n, const std::vector<int>& loads) {
  loads_.setZero(mechanics_.site_count());
  for (size_t i = 0; i < loads.size(); ++i) {
    ForSites(loads[i],
             [&](int site, double share) { loads_[site] += share * inward_n[static_cast<Eigen::Index>(i)]; });
  }
}

// Hills that have no more than a row between them may be parts of one hug; those further along the link are
// other bodies'.
void LoadEstimator::JoinHugs(const Linearization& skin, std::vector<Hill>& hills) {
  const int around = mechanics_.columns();
  std::vector<size_t> order(hills.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto first = [&](size_t i) { return *std::min_element(hills[i].begin(), hills[i].end()) / around; };
  const auto last = [&](size_t i) { return *std::max_element(hills[i].begin(), hills[i].end()) / around; };
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return first(a) < first(b); });
  std::vector<std::vector<size_t>> groups;
  int end = 0;
  for (const size_t i : order) {
    if (groups.empty() || first(i) > end + 2) groups.emplace_back();
    groups.back().push_back(i);
    end = std::max(end, last(i));
  }
  for (const std::vector<size_t>& group : groups) JoinHug(skin, hills, group);
  std::erase_if(hills, [](const Hill& hill) { return hill.empty(); });
}

// A hug, or a ring, presses alike all around: a few bands explain it. Fitted site by site it falls into
// contacts that differ from frame to frame, for what it does to an inflated skin is little beside what each
// of its sites would do alone. Several contacts are believed if they explain more than the bands do by what
// a contact has to explain, each. On solids, bodies that stand around the skin do by ten times as much.
void LoadEstimator::JoinHug(const Linearization& skin, std::vector<Hill>& hills,
                            const std::vector<size_t>& group) {
  const int sites = mechanics_.site_count(), around = mechanics_.columns();
  std::vector<char> is_loaded(static_cast<size_t>(around), 0);
  int first = mechanics_.site_rows(), last = 0;
  for (const size_t i : group) {
    for (const int site : hills[i]) {
      is_loaded[static_cast<size_t>(site % around)] = 1;
      first = std::min(first, site / around);
      last = std::max(last, site / around);
    }
  }
  if (WidestFree(is_loaded) > kMostFree) return;
  std::vector<Hill> with_hug = {{}};
  for (int row = first; row <= last; ++row) with_hug.front().push_back(sites + row);
  AddColumns(skin, with_hug.front());
  for (size_t i = 0; i < hills.size(); ++i) {
    if (std::find(group.begin(), group.end(), i) == group.end()) with_hug.push_back(hills[i]);
  }
  const Explanation hug = Explain(with_hug, with_hug.size());
  const double gain = hug.chi2 - Explain(hills, hills.size()).chi2;
  if (gain > kHillGain * static_cast<double>(group.size())) return;
  Hill bands;
  for (int row = first; row <= last; ++row) {
    const double load = hug.loads[row - first];
    loads_.segment(row * around, around).setConstant(load / around);
    if (load > 0) bands.push_back(sites + row);
  }
  for (const size_t i : group) hills[i].clear();
  hills[group.front()] = bands;
}

}  // namespace taclink
