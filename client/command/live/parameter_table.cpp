#include "client/command/live/parameter_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "client/command/cli/units.h"
#include "sensing/core/geometry.h"

namespace taclink::command {
namespace {

constexpr double kTinySigma = 5e-4;  // of the k's per px2 and px4

struct Shown {
  std::string unit;
  double factor = 1;
};

Shown UnitForPeople(const std::string& unit) {
  if (unit == "rad") return {"deg", DegFromRad(1)};
  return {unit == "1" ? "" : unit, 1};
}

std::string Label(const CalibrationParameter& one) {
  std::string name = one.name;
  std::ranges::replace(name, '_', ' ');
  return fmt::format("{:<18} {:>5}", name, UnitForPeople(one.unit).unit);
}

std::string Cell(const CalibrationParameter& one, double value, double sigma) {
  const double factor = UnitForPeople(one.unit).factor;
  const bool is_tiny = sigma > 0 && sigma < kTinySigma && one.unit != "rad" && one.unit != "mm";
  return is_tiny ? fmt::format("{:11.3e} \u00b1 {:<9.1e}", factor * value, factor * sigma)
                 : fmt::format("{:11.3f} \u00b1 {:<9.3f}", factor * value, factor * sigma);
}

std::vector<const CalibrationParameter*> Of(CameraId id, std::span<const CalibrationParameter> parameters) {
  std::vector<const CalibrationParameter*> out;
  for (const auto& one : parameters) {
    if (one.camera == id) out.push_back(&one);
  }
  return out;
}

// Parameters of one name in a row; cameras of different lenses have different numbers of them.
template <typename MakeCell>
void PrintRows(std::span<const CalibrationParameter> parameters, MakeCell make_cell) {
  fmt::print("{:<24} {:>24}   {:>24}\n", "", "top          ", "bottom        ");
  const auto top = Of(CameraId::kTop, parameters), bottom = Of(CameraId::kBottom, parameters);
  for (size_t i = 0; i < std::max(top.size(), bottom.size()); ++i) {
    const auto cell = [&](const auto& column) { return i < column.size() ? make_cell(*column[i]) : ""; };
    fmt::print("{} {:>23}   {:>23}\n", Label(i < top.size() ? *top[i] : *bottom[i]), cell(top), cell(bottom));
  }
}

}  // namespace

std::vector<CalibrationParameter> ToParameters(const v1::CalibrationResult& result) {
  std::vector<CalibrationParameter> out;
  for (const v1::CalibrationParameter& one : result.parameters()) {
    const bool is_length = one.unit() == "m";
    const double unit = is_length ? kMmPerMetre : 1;
    CalibrationParameter& parameter = out.emplace_back(CalibrationParameter{
        .camera = one.camera() == Name(CameraId::kBottom) ? CameraId::kBottom : CameraId::kTop,
        .name = one.name(),
        .unit = is_length ? "mm" : one.unit(),
        .value = unit * one.value(),
        .sigma = unit * one.fit_sigma()});
    if (one.has_mean()) parameter.mean = unit * one.mean();
    if (one.has_standard_deviation()) parameter.scatter = unit * one.standard_deviation();
  }
  return out;
}

void PrintParameters(std::span<const CalibrationParameter> parameters, size_t repeats) {
  fmt::print(
      "Parameter \u00b1 standard deviation of the fit; tilt and roll against the model's nominal camera\n");
  PrintRows(parameters, [](const auto& one) { return Cell(one, one.value, one.sigma); });
  if (repeats < 2) return;
  fmt::print("\nMean \u00b1 standard deviation over {} calibrations\n", repeats);
  PrintRows(parameters,
            [](const auto& one) { return Cell(one, one.mean.value_or(one.value), one.scatter.value_or(0)); });
}

Json ParametersJson(std::span<const CalibrationParameter> parameters) {
  Json out = Json::array();
  for (const auto& one : parameters) {
    out.push_back({{"camera", Name(one.camera)},
                   {"name", one.name},
                   {"unit", one.unit},
                   {"value", one.value},
                   {"fit_sigma", one.sigma},
                   {"mean", one.mean ? Json(*one.mean) : Json(nullptr)},
                   {"standard_deviation", one.scatter ? Json(*one.scatter) : Json(nullptr)}});
  }
  return out;
}

}  // namespace taclink::command
