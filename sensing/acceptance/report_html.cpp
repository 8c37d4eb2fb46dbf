#include "sensing/acceptance/report_html.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

#include "sensing/core/units.h"
#include "sensing/core/utc_time.h"

namespace taclink {
namespace {

constexpr double kPerCent = 100, kDegPerRad = 180 / std::numbers::pi;

std::string Escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string Text(const char* format, auto... values) {
  char text[400];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

struct Point {
  double x = 0, y = 0;
};
struct Curve {
  std::vector<Point> points;
  bool is_line = false;
};

/// Ticks at round numbers.
std::vector<double> Ticks(double low, double high) {
  const double rough = (high - low) / 5, power = std::pow(10, std::floor(std::log10(rough)));
  const double share = rough / power, step = power * (share < 1.5   ? 1
                                                      : share < 3.5 ? 2
                                                      : share < 7.5 ? 5
                                                                    : 10);
  std::vector<double> ticks;
  for (double tick = std::ceil(low / step) * step; tick <= high + 1e-9 * step; tick += step)
    ticks.push_back(std::abs(tick) < 1e-9 * step ? 0 : tick);
  return ticks;
}

/// One plot as SVG, with the line y = x (`is_diagonal`) or y = 0.
std::string Plot(const std::string& title, const std::string& x_label, const std::string& y_label,
                 const std::vector<Curve>& curves, bool is_diagonal = false) {
  constexpr double kWidth = 420, kHeight = 280, kLeft = 56, kRight = 12, kTop = 28, kBottom = 44;
  Point low{0, 0}, high{0, 0};
  bool any = false;
  for (const Curve& curve : curves) {
    for (const Point& p : curve.points) {
      if (!any) low = high = {p.x, std::min(0.0, p.y)};
      any = true;
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
  }
  // No plot for a single x value: the table shows the same.
  if (!any || (!is_diagonal && high.x - low.x < 1e-6 * std::max(1.0, std::abs(high.x)))) return "";
  if (is_diagonal) low = {0, 0}, high = {std::max(high.x, high.y), std::max(high.x, high.y)};
  const Point margin{0.06 * std::max(high.x - low.x, 1e-6), 0.08 * std::max(high.y - low.y, 1e-6)};
  low = {low.x - margin.x, low.y - margin.y};
  high = {high.x + margin.x, high.y + margin.y};
  const auto x_at = [&](double x) {
    return kLeft + (x - low.x) / (high.x - low.x) * (kWidth - kLeft - kRight);
  };
  const auto y_at = [&](double y) {
    return kHeight - kBottom - (y - low.y) / (high.y - low.y) * (kHeight - kTop - kBottom);
  };
  std::string svg =
      Text("<svg viewBox='0 0 %g %g' role='img'><title>", kWidth, kHeight) + Escaped(title) + "</title>";
  svg += Text("<text x='%g' y='16' class='t'>", kLeft) + Escaped(title) + "</text>";
  for (const double tick : Ticks(low.x, high.x))
    svg +=
        Text("<line x1='%.1f' x2='%.1f' y1='%g' y2='%g' class='g'/><text x='%.1f' y='%g' class='x'>%g</text>",
             x_at(tick), x_at(tick), kTop, kHeight - kBottom, x_at(tick), kHeight - kBottom + 14, tick);
  for (const double tick : Ticks(low.y, high.y))
    svg +=
        Text("<line x1='%g' x2='%g' y1='%.1f' y2='%.1f' class='g'/><text x='%g' y='%.1f' class='y'>%g</text>",
             kLeft, kWidth - kRight, y_at(tick), y_at(tick), kLeft - 6, y_at(tick) + 4, tick);
  const Point from{low.x, is_diagonal ? low.x : 0}, to{high.x, is_diagonal ? high.x : 0};
  svg += Text("<line x1='%.1f' y1='%.1f' x2='%.1f' y2='%.1f' class='r'/>", x_at(from.x), y_at(from.y),
              x_at(to.x), y_at(to.y));
  for (size_t i = 0; i < curves.size(); ++i) {
    std::string path;
    for (const Point& p : curves[i].points) {
      if (curves[i].is_line)
        path += Text("%s%.1f,%.1f", path.empty() ? "" : " ", x_at(p.x), y_at(p.y));
      else
        svg += Text("<circle cx='%.1f' cy='%.1f' r='3.2' class='c%d'/>", x_at(p.x), y_at(p.y),
                    static_cast<int>(i % 4));
    }
    if (!path.empty()) svg += "<polyline points='" + path + Text("' class='l%d'/>", static_cast<int>(i % 4));
  }
  svg += Text("<text x='%g' y='%g' class='x'>", (kLeft + kWidth - kRight) / 2, kHeight - 8) +
         Escaped(x_label) + "</text>";
  svg += Text("<text x='14' y='%g' class='v' transform='rotate(-90 14 %g)'>", kHeight / 2, kHeight / 2) +
         Escaped(y_label) + "</text></svg>\n";
  return svg;
}

std::string ForcePlot(const AcceptanceRecord& record) {
  Curve curve;
  for (const AcceptanceTrial& trial : record.trials) {
    const auto reference_n = ReferenceForce(trial);
    if (trial.state == TrialState::kMeasured && reference_n && trial.loaded && IsUsable(*trial.loaded))
      curve.points.push_back({*reference_n, trial.loaded->force_n});
  }
  return Plot("Measured force against the reference", "reference, N", "measured, N", {curve}, true);
}

std::string ErrorPlot(const AcceptanceReport& report, const std::string& title, const std::string& label,
                      const std::function<std::optional<double>(const LoadError&)>& x) {
  Curve curve;
  for (const LoadError& load : report.loads) {
    const auto at = x(load);
    if (at && load.force) curve.points.push_back({*at, kPerCent * *load.force});
  }
  return Plot(title, label, "force error, %", {curve});
}

std::string HoldPlot(const AcceptanceRecord& record) {
  std::vector<Curve> curves;
  for (const AcceptanceTrial& trial : record.trials) {
    if (trial.state != TrialState::kMeasured || !trial.loaded || trial.loaded->held.empty()) continue;
    const auto reference_n = ReferenceForce(trial);
    Curve curve{{}, true};
    for (const HeldSample& sample : trial.loaded->held)
      curve.points.push_back(
          {sample.time_s, reference_n ? kPerCent * (sample.force_n / *reference_n - 1) : sample.force_n});
    curves.push_back(std::move(curve));
  }
  return Plot("Held loads", "time, s", "force error, %", curves);
}

std::string PlacePlot(const AcceptanceRecord& record) {
  Curve reference, measured;
  for (const AcceptanceTrial& trial : record.trials) {
    if (trial.state != TrialState::kMeasured || !trial.reference.place_mm) continue;
    if (!trial.loaded || !trial.loaded->has_contact) continue;
    const Vec3 &a = *trial.reference.place_mm, &b = trial.loaded->center_mm;
    reference.points.push_back({a.z(), kDegPerRad * std::atan2(a.y(), a.x())});
    measured.points.push_back({b.z(), kDegPerRad * std::atan2(b.y(), b.x())});
  }
  return Plot("Places: reference (blue), measured (orange)", "z, mm", "angle, degrees",
              {reference, measured});
}

std::string QuantityRows(const AcceptanceReport& report) {
  std::string rows;
  for (const AcceptanceQuantity& q : report.quantities) {
    const bool is_measured = q.verdict != Verdict::kNotMeasured;
    rows += "<tr><td>" + Escaped(q.label) + "</td><td class='n'>";
    rows += is_measured ? Text("%.3g ", q.value) + Escaped(q.unit) : std::string("–");
    rows +=
        "</td><td class='n'>" + (q.low && q.high ? Text("%.3g … %.3g", *q.low, *q.high) : std::string("–"));
    rows +=
        "</td><td class='n'>" + (q.limit > 0 ? Text("%.3g ", q.limit) + Escaped(q.unit) : std::string("–"));
    rows += Text("</td><td class='n'>%d</td><td class='b%d'>", q.loads, static_cast<int>(q.verdict));
    rows += Name(q.verdict) + std::string("</td></tr>\n");
  }
  return rows;
}

std::string TrialRows(const AcceptanceRecord& record, const AcceptanceReport& report) {
  std::string rows;
  for (const AcceptanceTrial& trial : record.trials) {
    const auto load = std::ranges::find(report.loads, trial.id, &LoadError::trial);
    const bool has_load = load != report.loads.end();
    const auto reference_n = ReferenceForce(trial);
    rows += Text("<tr><td class='n'>%u</td><td>%s</td><td>", trial.id, Name(trial.kind));
    rows += trial.path > 0 ? Text("path %d, ring %d", trial.path, trial.ring) : std::string("–");
    rows += "</td><td class='n'>" + (reference_n ? Text("%.3f", *reference_n) : std::string("–"));
    rows += "</td><td class='n'>" + (trial.loaded ? Text("%.3f", trial.loaded->force_n) : std::string("–"));
    rows += "</td><td class='n'>" +
            (has_load && load->force ? Text("%+.1f", kPerCent * *load->force) : std::string("–"));
    rows += "</td><td class='n'>" +
            (has_load && load->place_mm ? Text("%.1f", *load->place_mm) : std::string("–"));
    rows +=
        "</td><td class='n'>" + (has_load && load->ghost_n ? Text("%.3f", *load->ghost_n) : std::string("–"));
    rows += "</td><td class='n'>" +
            (has_load && load->pressure_kpa ? Text("%.2f", *load->pressure_kpa) : std::string("–"));
    rows += "</td><td>";
    if (trial.state == TrialState::kSkipped) rows += "skipped";
    if (trial.state == TrialState::kOpen) rows += "open";
    if (trial.loaded && !trial.loaded->reasons.empty()) rows += Escaped(trial.loaded->reasons.front().text);
    rows += "</td></tr>\n";
  }
  return rows;
}

constexpr const char* kStyle = R"(<style>
body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1000px;padding:0 1em;color:#1b1f24;background:#fff}
h1{margin:0 0 .2em}h2{margin:1.6em 0 .4em}table{border-collapse:collapse;width:100%}
td,th{padding:.25em .6em;border-bottom:1px solid #dde;text-align:left;vertical-align:top}.n{text-align:right;white-space:nowrap}
.v{display:inline-block;padding:.2em .8em;border-radius:.4em;font-weight:600;color:#fff}
.v0{background:#1a7f37}.v1{background:#b42318}.v2,.v3,.v4{background:#8a5a00}
.b0{color:#1a7f37}.b1{color:#b42318;font-weight:600}.b2{color:#8a5a00}.b3,.b4{color:#667}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(380px,1fr));gap:1em}svg{width:100%;height:auto}
svg text{font:11px system-ui,sans-serif;fill:#445}svg .t{font-weight:600;fill:#1b1f24}svg .x,svg .v{text-anchor:middle}svg .y{text-anchor:end}
.g{stroke:#e6e8ee}.r{stroke:#99a;stroke-dasharray:4 3}.c0,.c2{fill:#1f6feb}.c1,.c3{fill:#d9730d}
.l0{stroke:#1f6feb;fill:none}.l1{stroke:#d9730d;fill:none}.l2{stroke:#1a7f37;fill:none}.l3{stroke:#8250df;fill:none}
</style>)";

}  // namespace

std::string AcceptanceHtml(const AcceptanceRecord& record, const AcceptanceReport& report) {
  const std::string title = "Acceptance of link " + record.link;
  std::string page = "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>" + Escaped(title) +
                     "</title>\n<meta name='viewport' content='width=device-width'>" + kStyle +
                     "</head><body>\n";
  page += "<h1>" + Escaped(title) + "</h1>\n";
  page +=
      Text("<p><span class='v v%d'>", static_cast<int>(report.verdict)) + Name(report.verdict) + "</span> ";
  page += "plan " + Escaped(record.plan) + ", model " + Escaped(record.model) + ", ";
  page += record.finished_utc_ns > 0 ? "finished " + UtcText(record.finished_utc_ns / 1'000'000'000)
                                     : std::string("not finished");
  page +=
      Text("; %d trials measured, %d skipped, %d open</p>\n", report.measured, report.skipped, report.open);
  if (!record.model_hash.empty()) page += "<p>Model file " + Escaped(record.model_hash) + "</p>\n";
  if (record.calibrated_utc_ns > 0)
    page += "<p>Cameras calibrated " + UtcText(record.calibrated_utc_ns / 1'000'000'000) + "</p>\n";
  page += "<h2>Findings</h2>\n";
  if (report.findings.empty()) page += "<p>None.</p>\n";
  for (const AcceptanceFinding& finding : report.findings)
    page += "<p><b>" + std::string(Name(finding.id)) + "</b>: " + Escaped(finding.text) + "</p>\n";
  page +=
      "<h2>Quantities</h2>\n<table><tr><th>Quantity</th><th class='n'>Value</th><th class='n'>95 % "
      "interval</th>"
      "<th class='n'>Limit</th><th class='n'>Loads</th><th>Verdict</th></tr>\n" +
      QuantityRows(report) + "</table>\n<h2>Plots</h2>\n<div class='plots'>\n";
  page += ForcePlot(record) + PlacePlot(record) + HoldPlot(record);
  page += ErrorPlot(report, "Force error against pressure", "pressure, kPa",
                    [](const LoadError& load) { return load.pressure_kpa; });
  page += ErrorPlot(report, "Force error over time", "time, min",
                    [](const LoadError& load) { return std::optional(60 * load.hours); });
  page +=
      "</div>\n<h2>Trials</h2>\n<table><tr><th class='n'>No.</th><th>Kind</th><th>Place</th><th "
      "class='n'>Reference, N</th>"
      "<th class='n'>Measured, N</th><th class='n'>Error, %</th><th class='n'>Place error, mm</th>"
      "<th class='n'>Left, N</th><th class='n'>kPa</th><th>Note</th></tr>\n" +
      TrialRows(record, report) + "</table>\n";
  page +=
      "<p>Relative errors are (measured − reference) / reference. Intervals of means and slopes hold the "
      "true "
      "value in 95 of 100 acceptances; places are the independent samples. Intervals of percentiles are "
      "resampled from the places that were measured: of fewer than some 20 places they are too narrow for "
      "others. A verdict is undecided where the interval contains the limit, or what the plan has trials for "
      "was not measured: more places decide it.</p>\n</body></html>\n";
  return page;
}

std::string AcceptanceCsv(const AcceptanceRecord& record, const AcceptanceReport& report) {
  std::string csv =
      "trial,kind,state,path,ring,attitude,repetition,reference_n,measured_n,measured_sd_n,stated_sigma_n,"
      "force_error,"
      "place_error_mm,balance_error,left_n,phantom_n,pressure_kpa,frames,usable_frames,utc_ns\n";
  const auto number = [&csv](const std::optional<double>& value) {
    csv += value ? Text("%.6g,", *value) : ",";
  };
  constexpr const char* kStates[] = {"open", "measured", "skipped"};
  for (const AcceptanceTrial& trial : record.trials) {
    const auto load = std::ranges::find(report.loads, trial.id, &LoadError::trial);
    const LoadError error = load != report.loads.end() ? *load : LoadError{};
    std::string attitude = trial.attitude;
    std::ranges::replace_if(attitude, [](char c) { return c == ',' || c == '"' || c == '\n'; }, ' ');
    csv += Text("%u,%s,%s,%d,%d,", trial.id, Name(trial.kind), kStates[static_cast<size_t>(trial.state)],
                trial.path, trial.ring) +
           attitude + Text(",%d,", trial.repetition);
    number(ReferenceForce(trial));
    number(trial.loaded ? std::optional(trial.loaded->force_n) : std::nullopt);
    number(trial.loaded ? std::optional(trial.loaded->force_sd_n) : std::nullopt);
    number(trial.loaded ? trial.loaded->stated_sigma_n : std::nullopt);
    number(error.force);
    number(error.place_mm);
    number(error.balance);
    number(error.ghost_n);
    number(error.phantom_n);
    number(error.pressure_kpa);
    csv += trial.loaded ? Text("%d,%d,%lld\n", trial.loaded->frames, trial.loaded->usable,
                               static_cast<long long>(trial.loaded->utc_ns))
                        : std::string(",,\n");
  }
  return csv;
}

}  // namespace taclink
