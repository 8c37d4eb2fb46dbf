#include "sensing/acceptance/quantities.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace taclink {
namespace {

Verdict VerdictOf(double low, double high, double limit) {
  const double worst = std::max(std::abs(low), std::abs(high));
  const double best = low > 0 ? low : high < 0 ? -high : 0;
  return worst <= limit ? Verdict::kPassed : best > limit ? Verdict::kFailed : Verdict::kUndecided;
}

// Sets rounding errors to zero.
double Rounded(double value) {
  return std::abs(value) < 1e-9 ? 0 : value;
}

void Judge(AcceptanceQuantity& quantity) {
  quantity.value = Rounded(quantity.value);
  if (quantity.low) quantity.low = Rounded(*quantity.low);
  if (quantity.high) quantity.high = Rounded(*quantity.high);
  if (quantity.loads == 0)
    quantity.verdict = Verdict::kNotMeasured;
  else if (quantity.limit == 0)
    quantity.verdict = Verdict::kUnlimited;
  else if (!quantity.low || !quantity.high)
    quantity.verdict = Verdict::kUndecided;
  else
    quantity.verdict = VerdictOf(*quantity.low, *quantity.high, quantity.limit);
}

}  // namespace

std::string Interval(const Estimate& estimate, double scale, const char* format) {
  std::string text = Format(format, scale * estimate.value);
  if (estimate.half_width)
    text +=
        " ± " + Format(*format == '%' && format[1] == '+' ? "%.1f" : format, scale * *estimate.half_width);
  return text;
}

AcceptanceQuantity Describe(std::string id, std::string label, std::string unit, double limit) {
  return {.id = std::move(id),
          .label = std::move(label),
          .unit = std::move(unit),
          .low = {},
          .high = {},
          .limit = limit};
}

void Set(AcceptanceQuantity& quantity, const Estimate& estimate, int loads, double scale) {
  quantity.value = scale * estimate.value;
  if (estimate.half_width) {
    quantity.low = scale * (estimate.value - *estimate.half_width);
    quantity.high = scale * (estimate.value + *estimate.half_width);
  }
  quantity.loads = loads;
  Judge(quantity);
}

void Set(AcceptanceQuantity& quantity, const PercentileEstimate& estimate, int loads, double scale) {
  quantity.value = scale * estimate.value;
  if (estimate.low) quantity.low = scale * *estimate.low;
  if (estimate.high) quantity.high = scale * *estimate.high;
  quantity.loads = estimate.samples > 0 ? loads : 0;
  Judge(quantity);
}

std::vector<GroupedValue> Values(const std::vector<LoadError>& loads, ErrorOfLoad error, bool magnitudes) {
  std::vector<GroupedValue> values;
  for (const LoadError& load : loads)
    if (load.*error) values.push_back({load.place, magnitudes ? std::abs(*(load.*error)) : *(load.*error)});
  return values;
}

}  // namespace taclink
