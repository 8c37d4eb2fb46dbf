#include "client/command/offline/stiffness_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/command/cli/csv.h"
#include "client/command/cli/json.h"
#include "client/command/offline/curve_plot.h"
#include "sensing/core/units.h"

namespace taclink::command {
namespace {

std::string PlaceText(const StiffnessRow& row) {
  return fmt::format("{},{}", row.path, row.ring);
}

using StiffnessValue = double SkinStiffness::*;

CurvePanel StiffnessPanel(const StiffnessReport& report, const std::string& label, StiffnessValue value) {
  CurvePanel panel{.x_label = "gauge pressure, kPa", .y_label = label, .curves = {}};
  for (const StiffnessRow& row : report.rows) {
    const std::string name = fmt::format("path {}, ring {}", row.path, row.ring);
    auto curve = std::ranges::find(panel.curves, name, &PlotCurve::name);
    if (curve == panel.curves.end())
      curve = panel.curves.insert(curve, PlotCurve{.name = name, .colour = {}, .x = {}, .y = {}});
    curve->x.push_back(row.pressure_kpa);
    curve->y.push_back(row.stiffness ? (*row.stiffness).*value : NAN);
  }
  for (size_t i = 0; i < panel.curves.size(); ++i)
    panel.curves[i].colour = RampColour(i, panel.curves.size());
  return panel;
}

}  // namespace

void PrintStiffness(const StiffnessReport& report) {
  fmt::print(
      "{}: stiffness against a disc of {:g} mm, pressed {:g} mm into the skin from where it touches\n"
      "secant: force over that depth; onset: slope where the disc begins to bear\n",
      report.model, report.disc_diameter_mm, report.indentation_mm);
  if (report.is_one_path)
    fmt::print("without gravity all paths are alike by symmetry: path 1 stands for them\n");
  fmt::print("  place    z mm     kPa  grown mm  force N  secant N/mm  onset N/mm\n");
  for (const StiffnessRow& row : report.rows) {
    fmt::print("{:>7}  {:6.1f}  {:6.3f}  ", PlaceText(row), row.z_mm, row.pressure_kpa);
    if (row.stiffness) {
      fmt::print("{:8.2f}  {:7.3f}  {:11.4f}  {:10.4f}\n", row.stiffness->inflation_mm,
                 row.stiffness->force_n, row.stiffness->secant_n_per_mm, row.stiffness->onset_n_per_mm);
    } else {
      fmt::print("{}\n", row.stiffness.error().message);
    }
  }
}

std::string StiffnessJson(const StiffnessReport& report) {
  Json rows = Json::array();
  for (const StiffnessRow& row : report.rows) {
    Json one = {
        {"path", row.path}, {"ring", row.ring}, {"z_mm", row.z_mm}, {"pressure_kpa", row.pressure_kpa}};
    if (row.stiffness) {
      one["inflation_mm"] = row.stiffness->inflation_mm;
      one["force_n"] = row.stiffness->force_n;
      one["secant_n_per_mm"] = row.stiffness->secant_n_per_mm;
      one["onset_n_per_mm"] = row.stiffness->onset_n_per_mm;
    } else {
      one["problem"] = row.stiffness.error().message;
    }
    rows.push_back(std::move(one));
  }
  return Json({{"model", report.model},
               {"depth_mm", report.indentation_mm},
               {"patch_diameter_mm", report.disc_diameter_mm},
               {"one_path_by_symmetry", report.is_one_path},
               {"rows", rows}})
      .dump();
}

std::string StiffnessCsv(const StiffnessReport& report) {
  std::string out =
      "path,ring,z_mm,pressure_kpa,inflation_mm,depth_mm,force_n,secant_n_per_mm,onset_n_per_mm,problem\n";
  for (const StiffnessRow& row : report.rows) {
    out += fmt::format("{},{},{:g},{:g},", row.path, row.ring, row.z_mm, row.pressure_kpa);
    if (row.stiffness) {
      out += fmt::format("{:.6g},{:g},{:.6g},{:.6g},{:.6g},\n", row.stiffness->inflation_mm,
                         report.indentation_mm, row.stiffness->force_n, row.stiffness->secant_n_per_mm,
                         row.stiffness->onset_n_per_mm);
    } else {
      out += fmt::format(",{:g},,,,{}\n", report.indentation_mm, CsvCell(row.stiffness.error().message));
    }
  }
  return out;
}

std::string StiffnessSvg(const StiffnessReport& report) {
  return CurvePlot(
      fmt::format("{}: stiffness against a disc of {:g} mm", report.model, report.disc_diameter_mm),
      {StiffnessPanel(report, fmt::format("secant over {:g} mm, N/mm", report.indentation_mm),
                      &SkinStiffness::secant_n_per_mm),
       StiffnessPanel(report, "at contact onset, N/mm", &SkinStiffness::onset_n_per_mm)});
}

ComparisonMean MeanUnderPressure(const std::vector<ComparedRow>& rows) {
  ComparisonMean mean;
  for (const ComparedRow& row : rows) {
    if (!(row.measured.pressure_mpa > 0) || !std::isfinite(row.error())) continue;
    ++mean.rows;
    mean.error += std::abs(row.error());
  }
  if (mean.rows > 0) mean.error /= mean.rows;
  return mean;
}

void PrintComparison(const std::vector<ComparedRow>& rows) {
  fmt::print("ring  depth mm     kPa  measured N  computed N  error %\n");
  for (const ComparedRow& row : rows) {
    fmt::print("{:4d}  {:8.2f}  {:6.3f}  {:10.4f}  {:10.4f}  ", row.measured.ring + 1, row.measured.depth_mm,
               row.measured.pressure_mpa / kMpaPerKpa, row.measured.force_n, row.computed_n);
    fmt::print("{}\n", std::isfinite(row.error()) ? fmt::format("{:+7.1f}", 100 * row.error()) : "      -");
  }
  const ComparisonMean mean = MeanUnderPressure(rows);
  if (mean.rows > 0) {
    fmt::print("mean absolute error over the {} rows under pressure: {:.1f} %\n", mean.rows,
               100 * mean.error);
  } else {
    fmt::print("no row is under pressure: there is no mean error\n");
  }
}

std::string ComparisonJson(const std::string& model, const std::vector<ComparedRow>& rows) {
  Json list = Json::array();
  for (const ComparedRow& row : rows) {
    Json one = {{"ring", row.measured.ring + 1},
                {"depth_mm", row.measured.depth_mm},
                {"pressure_kpa", row.measured.pressure_mpa / kMpaPerKpa},
                {"measured_n", row.measured.force_n},
                {"computed_n", row.computed_n}};
    one["error_percent"] = std::isfinite(row.error()) ? Json(100 * row.error()) : Json(nullptr);
    list.push_back(std::move(one));
  }
  const ComparisonMean mean = MeanUnderPressure(rows);
  return Json({{"model", model},
               {"rows", list},
               {"rows_under_pressure", mean.rows},
               {"mean_absolute_error_percent", mean.rows > 0 ? Json(100 * mean.error) : Json(nullptr)}})
      .dump();
}

std::string ComparisonCsv(const std::vector<ComparedRow>& rows) {
  std::string out = "ring,depth_mm,pressure_kpa,measured_n,computed_n,error_percent\n";
  for (const ComparedRow& row : rows) {
    out += fmt::format("{},{:g},{:g},{:g},{:.6g},", row.measured.ring + 1, row.measured.depth_mm,
                       row.measured.pressure_mpa / kMpaPerKpa, row.measured.force_n, row.computed_n);
    out += std::isfinite(row.error()) ? fmt::format("{:.3f}\n", 100 * row.error()) : "\n";
  }
  return out;
}

}  // namespace taclink::command
