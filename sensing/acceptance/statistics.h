#pragma once

#include <optional>
#include <span>
#include <vector>

namespace taclink {

/// A value and the half-width of its 95 % confidence interval. All intervals are two-sided, since errors may
/// have either sign, and symmetric except for PercentileEstimate.
struct Estimate {
  double value = 0;
  std::optional<double> half_width;  ///< none: too few data
  int samples = 0;                   ///< independent samples: places, not loads

  bool excludes_zero() const { return half_width && (value > *half_width || value < -*half_width); }
};

/// A percentile with the bounds of its 95 % confidence interval.
struct PercentileEstimate {
  double value = 0;
  std::optional<double> low, high;  ///< none: too few data
  int samples = 0;
};

/// A value of a group. Values of one group are correlated: loads at one place share its errors.
struct GroupedValue {
  int group = 0;
  double value = 0;
};

/// Two-sided 95 % quantile of Student's t distribution.
double StudentT95(double degrees_of_freedom);

/// Mean of the group means, and its t interval: groups are the independent samples. No half-width with fewer
/// than two groups.
Estimate GroupedMean(std::span<const GroupedValue> values);

/// Percentile (0 to 1) of all values. Bounds: bootstrap over whole groups (fixed seed, for reproducible
/// reports), from two groups on. No bound exceeds the largest value: with few groups the bounds hold for
/// these groups, and are too narrow for others.
PercentileEstimate GroupedPercentile(std::span<const GroupedValue> values, double percentile);

/// Pooled standard deviation of repeated values within groups; bounds from the chi-squared distribution.
/// Without repetitions, no samples.
PercentileEstimate PooledDeviation(std::span<const GroupedValue> values);

/// A straight line through points with an offset for each group.
struct LineFit {
  Estimate slope;
  Estimate intercept;  ///< mean over groups, at x = 0
};
/// Least squares with group offsets, over the groups in which x spans at least `least_span`. The slope's
/// half-width is from the residual variance by group (sandwich estimator, t quantile of groups - 1 degrees of
/// freedom), for a single group from its points; likewise the intercept's. None: no group has that span.
std::optional<LineFit> FitLine(std::span<const GroupedValue> x, std::span<const double> y, double least_span);

}  // namespace taclink
