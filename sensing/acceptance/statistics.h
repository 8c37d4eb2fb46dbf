#pragma once

#include <optional>
#include <span>
#include <vector>

namespace taclink {

/// A number with half the width of its 95 % confidence interval. Intervals of one side would be misleading
/// for quantities that may be off to either side, hence all are symmetric but PercentileEstimate.
struct Estimate {
  double value = 0;
  std::optional<double> half_width;  ///< none: too few data to tell
  int samples = 0;                   ///< independent ones: places, not loads

  bool excludes_zero() const { return half_width && (value > *half_width || value < -*half_width); }
};

/// A percentile with the bounds of its 95 % confidence interval.
struct PercentileEstimate {
  double value = 0;
  std::optional<double> low, high;  ///< none: too few data to tell
  int samples = 0;
};

/// Values that belong to one group: loads at one place share what is wrong there.
struct GroupedValue {
  int group = 0;
  double value = 0;
};

/// Two-sided 95 % quantile of Student's t distribution.
double StudentT95(double degrees_of_freedom);

/// Mean over groups of the means within groups, and its t interval: groups are the independent samples. No
/// width with fewer than two groups.
Estimate GroupedMean(std::span<const GroupedValue> values);

/// Percentile (0 to 1) of all values; bounds by resampling whole groups (seeded, so that a report can be made
/// again), at least two groups. No bound exceeds the largest value: of few groups they are those of the
/// groups that were measured, and too narrow for others.
PercentileEstimate GroupedPercentile(std::span<const GroupedValue> values, double percentile);

/// Standard deviation within groups of repeated values, pooled; bounds by the chi-squared distribution. None
/// of it without repetitions.
PercentileEstimate PooledDeviation(std::span<const GroupedValue> values);

/// A straight line through points whose groups each have an offset of their own.
struct LineFit {
  Estimate slope;
  Estimate intercept;  ///< mean over groups, at x = 0
};
/// Least squares with group offsets, by the groups within which x varies by `least_span` at least; the
/// slope's width from the residuals' variance by group (sandwich with the t quantile of groups - 1 degrees of
/// freedom), of one such group from its points. The intercept's width likewise. None: x varies so much within
/// no group.
std::optional<LineFit> FitLine(std::span<const GroupedValue> x, std::span<const double> y, double least_span);

}  // namespace taclink
