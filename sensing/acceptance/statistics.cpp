#include "sensing/acceptance/statistics.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <map>
#include <random>
#include <ranges>
#include <utility>

namespace taclink {
namespace {

constexpr double kTail = 0.025;  // on either side of a 95 % interval
constexpr int kResamples = 1000;

using Groups = std::vector<std::vector<double>>;

Groups GroupsOf(std::span<const GroupedValue> values) {
  std::map<int, std::vector<double>> by_group;
  for (const GroupedValue& one : values) by_group[one.group].push_back(one.value);
  Groups groups;
  for (auto& [group, of_group] : by_group) groups.push_back(std::move(of_group));
  return groups;
}

double Mean(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// Empirical quantile at position (n - 1) share, linearly interpolated.
double Quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  const double at = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<size_t>(at);
  const size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - static_cast<double>(below)) * (values[above] - values[below]);
}

}  // namespace

double StudentT95(double degrees_of_freedom) {
  return boost::math::quantile(boost::math::complement(boost::math::students_t(degrees_of_freedom), kTail));
}

Estimate GroupedMean(std::span<const GroupedValue> values) {
  if (values.empty()) return {};
  std::vector<double> means;
  for (const auto& group : GroupsOf(values)) means.push_back(Mean(group));
  Estimate estimate{.value = Mean(means), .half_width = {}, .samples = static_cast<int>(means.size())};
  if (means.size() < 2) return estimate;
  double sum2 = 0;
  for (const double mean : means) sum2 += (mean - estimate.value) * (mean - estimate.value);
  const auto n = static_cast<double>(means.size());
  estimate.half_width = StudentT95(n - 1) * std::sqrt(sum2 / (n - 1) / n);
  return estimate;
}

PercentileEstimate GroupedPercentile(std::span<const GroupedValue> values, double percentile) {
  if (values.empty()) return {};
  const Groups groups = GroupsOf(values);
  const auto pooled = [&](const auto& pick) {
    std::vector<double> all;
    for (size_t i = 0; i < groups.size(); ++i) {
      const auto& group = groups[pick(i)];
      all.insert(all.end(), group.begin(), group.end());
    }
    return Quantile(std::move(all), percentile);
  };
  PercentileEstimate estimate{.value = pooled([](size_t i) { return i; }),
                              .low = {},
                              .high = {},
                              .samples = static_cast<int>(groups.size())};
  if (groups.size() < 2) return estimate;
  std::mt19937_64 random(1);
  std::vector<double> resampled;
  resampled.reserve(kResamples);
  for (int i = 0; i < kResamples; ++i)
    resampled.push_back(pooled([&](size_t) { return static_cast<size_t>(random() % groups.size()); }));
  estimate.low = Quantile(resampled, kTail);
  estimate.high = Quantile(std::move(resampled), 1 - kTail);
  return estimate;
}

PercentileEstimate PooledDeviation(std::span<const GroupedValue> values) {
  double sum2 = 0;
  int freedom = 0, groups = 0;
  for (const auto& group : GroupsOf(values)) {
    if (group.size() < 2) continue;
    const double mean = Mean(group);
    for (const double value : group) sum2 += (value - mean) * (value - mean);
    freedom += static_cast<int>(group.size()) - 1;
    ++groups;
  }
  if (freedom == 0) return {};
  const boost::math::chi_squared chi2(freedom);
  return {.value = std::sqrt(sum2 / freedom),
          .low = std::sqrt(sum2 / boost::math::quantile(boost::math::complement(chi2, kTail))),
          .high = std::sqrt(sum2 / boost::math::quantile(chi2, kTail)),
          .samples = groups};
}

std::optional<LineFit> FitLine(std::span<const GroupedValue> x, std::span<const double> y,
                               double least_span) {
  std::map<int, std::vector<std::pair<double, double>>> groups;
  for (size_t i = 0; i < x.size(); ++i) groups[x[i].group].emplace_back(x[i].value, y[i]);
  std::erase_if(groups, [&](const auto& group) {
    const auto [least, most] = std::ranges::minmax(group.second | std::views::keys);
    return !(most - least >= least_span) || !(most > least);
  });
  if (groups.empty()) return std::nullopt;
  struct Means {
    double x = 0, y = 0;
  };
  std::map<int, Means> means;
  double xx = 0, xy = 0, points = 0;
  for (const auto& [id, group] : groups) {
    Means& of = means[id];
    const auto n = static_cast<double>(group.size());
    for (const auto& [px, py] : group) of.x += px / n, of.y += py / n;
    for (const auto& [px, py] : group) xx += (px - of.x) * (px - of.x), xy += (px - of.x) * (py - of.y);
    points += n;
  }
  LineFit fit;
  fit.slope = {.value = xy / xx, .half_width = {}, .samples = static_cast<int>(groups.size())};
  // Scores by group: a group's own offset cancels, its own slope does not.
  double residual2 = 0, scores2 = 0;
  for (const auto& [id, group] : groups) {
    double score = 0;
    for (const auto& [px, py] : group) {
      const double residual = py - means[id].y - fit.slope.value * (px - means[id].x);
      score += (px - means[id].x) * residual;
      residual2 += residual * residual;
    }
    scores2 += score * score;
  }
  const auto count = static_cast<double>(groups.size());
  const double freedom = points - count - 1;
  const double variance = freedom > 0 ? residual2 / freedom : 0;
  if (groups.size() >= 2) {
    const double of_groups = count / (count - 1) * scores2 / (xx * xx);
    fit.slope.half_width = StudentT95(count - 1) * std::sqrt(std::max(variance / xx, of_groups));
  } else if (freedom > 0) {
    fit.slope.half_width = StudentT95(freedom) * std::sqrt(variance / xx);
  }
  std::vector<GroupedValue> offsets;
  for (const auto& [id, of] : means) offsets.push_back({id, of.y - fit.slope.value * of.x});
  fit.intercept = GroupedMean(offsets);
  if (groups.size() == 1 && freedom > 0) {
    const double mean_x = means.begin()->second.x;
    fit.intercept.half_width =
        StudentT95(freedom) * std::sqrt(variance * (1 / points + mean_x * mean_x / xx));
  }
  return fit;
}

}  // namespace taclink
