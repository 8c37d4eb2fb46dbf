#include "sensing/acceptance/statistics.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <map>
#include <random>

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

// The empirical quantile at (n - 1) share, linear between the two values around it.
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

std::optional<LineFit> FitLine(std::span<const GroupedValue> x, std::span<const double> y) {
  struct Sums {
    double x = 0, y = 0, n = 0;
  };
  std::map<int, Sums> means;
  for (size_t i = 0; i < x.size(); ++i) {
    Sums& of_group = means[x[i].group];
    of_group.x += x[i].value;
    of_group.y += y[i];
    of_group.n += 1;
  }
  double xx = 0, xy = 0;
  const auto centered = [&](size_t i) {
    const Sums& of_group = means[x[i].group];
    return std::pair(x[i].value - of_group.x / of_group.n, y[i] - of_group.y / of_group.n);
  };
  for (size_t i = 0; i < x.size(); ++i) {
    const auto [dx, dy] = centered(i);
    xx += dx * dx;
    xy += dx * dy;
  }
  if (!(xx > 1e-12)) return std::nullopt;
  LineFit fit;
  fit.slope.value = xy / xx;
  // Scores by group: offsets of a group cancel within it, a slope of its own does not.
  std::map<int, double> scores;
  double residual2 = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const auto [dx, dy] = centered(i);
    const double residual = dy - fit.slope.value * dx;
    scores[x[i].group] += dx * residual;
    residual2 += residual * residual;
  }
  const auto groups = static_cast<double>(scores.size());
  fit.slope.samples = static_cast<int>(scores.size());
  const double freedom = static_cast<double>(x.size()) - groups - 1;
  double variance = freedom > 0 ? residual2 / freedom / xx : 0;
  if (scores.size() >= 2) {
    double of_groups = 0;
    for (const auto& [group, score] : scores) of_groups += score * score;
    variance = std::max(variance, groups / (groups - 1) * of_groups / (xx * xx));
  }
  if (scores.size() >= 2)
    fit.slope.half_width = StudentT95(groups - 1) * std::sqrt(variance);
  else if (freedom > 0)
    fit.slope.half_width = StudentT95(freedom) * std::sqrt(variance);
  std::vector<GroupedValue> offsets;
  for (const auto& [group, of_group] : means)
    offsets.push_back({group, (of_group.y - fit.slope.value * of_group.x) / of_group.n});
  fit.intercept = GroupedMean(offsets);
  return fit;
}

}  // namespace taclink
