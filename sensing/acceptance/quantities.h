#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "sensing/acceptance/acceptance_report.h"
#include "sensing/acceptance/load_errors.h"
#include "sensing/acceptance/statistics.h"

namespace taclink {

inline constexpr double kPercent = 100;

/// Formats like printf, at most 399 characters.
std::string Format(const char* format, auto... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// "+3.1 ± 0.8": the estimate times `scale`.
std::string Interval(const Estimate& estimate, double scale, const char* format);

/// A quantity that has no value yet.
AcceptanceQuantity Describe(std::string id, std::string label, std::string unit, double limit);

/// Sets value, interval and verdict. `loads`: number of loads evaluated.
void Set(AcceptanceQuantity& quantity, const Estimate& estimate, int loads, double scale = 1);
void Set(AcceptanceQuantity& quantity, const PercentileEstimate& estimate, int loads, double scale = 1);

/// One error of all loads that have it, grouped by place.
using ErrorOfLoad = std::optional<double> LoadError::*;
std::vector<GroupedValue> Values(const std::vector<LoadError>& loads, ErrorOfLoad error, bool magnitudes);

}  // namespace taclink
