#include "client/command/offline/curve_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/command/cli/svg.h"

namespace taclink::command {
namespace {

// Pixels.
constexpr double kPanelWidth = 400, kPanelHeight = 300, kPanelLeft = 70, kPanelHead = 60, kPanelFoot = 60,
                 kLegendWidth = 150, kLegendRow = 18;
constexpr int kMostTicks = 6;

struct CurveAxis {
  double low = 0, high = 1, step = 1;

  CurveAxis(double least, double most) {
    step = svg::TickStep(std::max(most - least, 1e-9), kMostTicks);
    low = std::floor(least / step + 1e-9) * step;
    high = std::max(std::ceil(most / step - 1e-9) * step, low + step);
  }
  double Share(double value) const { return (value - low) / (high - low); }
};

struct CurveRange {
  double least = INFINITY, most = -INFINITY;

  void Add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
};

std::string CurvePath(const PlotCurve& curve, const CurveAxis& x, const CurveAxis& y, double left) {
  std::string path, points;
  bool is_open = false;
  for (size_t i = 0; i < curve.x.size(); ++i) {
    if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) {
      is_open = false;
      continue;
    }
    const double px = left + x.Share(curve.x[i]) * kPanelWidth;
    const double py = kPanelHead + (1 - y.Share(curve.y[i])) * kPanelHeight;
    path += fmt::format("{}{:.1f} {:.1f}", is_open ? 'L' : 'M', px, py);
    points +=
        fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\" fill=\"{}\"/>\n", px, py, curve.colour);
    is_open = true;
  }
  if (path.empty()) return {};
  return fmt::format("<path class=\"curve\" d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>\n",
                     path, curve.colour) +
         points;
}

std::string PanelSvg(const CurvePanel& panel, double left) {
  CurveRange x_range, y_range;
  for (const PlotCurve& curve : panel.curves) {
    for (size_t i = 0; i < curve.x.size(); ++i) {
      if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) continue;
      x_range.Add(curve.x[i]);
      y_range.Add(curve.y[i]);
    }
  }
  const double bottom = kPanelHead + kPanelHeight;
  if (x_range.least > x_range.most)
    return svg::Text(left + kPanelWidth / 2, kPanelHead + kPanelHeight / 2, "middle", "nothing was computed");
  y_range.Add(0);
  const CurveAxis x(x_range.least, x_range.most), y(y_range.least, y_range.most);
  std::string out = "<g class=\"panel\">\n";
  for (const double tick : svg::Ticks(x.low, x.high, x.step)) {
    const double at = left + x.Share(tick) * kPanelWidth;
    out += svg::Line(at, kPanelHead, at, bottom, "stroke=\"#e4e4e4\"") +
           svg::Text(at, bottom + 16, "middle", svg::TickText(tick, x.step));
  }
  for (const double tick : svg::Ticks(y.low, y.high, y.step)) {
    const double at = bottom - y.Share(tick) * kPanelHeight;
    out += svg::Line(left, at, left + kPanelWidth, at, "stroke=\"#e4e4e4\"") +
           svg::Text(left - 6, at + 4, "end", svg::TickText(tick, y.step));
  }
  out += svg::Text(left + kPanelWidth / 2, bottom + 40, "middle", panel.x_label);
  const double middle = kPanelHead + kPanelHeight / 2;
  out += svg::Text(left - 48, middle, "middle", panel.y_label,
                   fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", left - 48, middle));
  for (const PlotCurve& curve : panel.curves) out += CurvePath(curve, x, y, left);
  return out + "</g>\n";
}

}  // namespace

std::string RampColour(size_t index, size_t count) {
  const double share = count > 1 ? static_cast<double>(index) / static_cast<double>(count - 1) : 0;
  return fmt::format("hsl({:.0f},70%,42%)", 220 + 140 * share);
}

std::string CurvePlot(const std::string& title, const std::vector<CurvePanel>& panels) {
  size_t names = 0;
  for (const PlotCurve& curve : panels.front().curves) names += curve.name.empty() ? 0 : 1;
  const double pitch = kPanelLeft + kPanelWidth + 20;
  const double width = pitch * static_cast<double>(panels.size()) + kLegendWidth;
  const double height = std::max(kPanelHead + kPanelHeight + kPanelFoot,
                                 kPanelHead + kLegendRow * static_cast<double>(names + 1));
  std::string out = svg::Open(width, height) +
                    svg::Text(kPanelLeft, 30, "start", title, " font-size=\"15\" font-weight=\"bold\"");
  for (size_t i = 0; i < panels.size(); ++i)
    out += PanelSvg(panels[i], kPanelLeft + pitch * static_cast<double>(i));
  double row = kPanelHead + 10;
  const double left = pitch * static_cast<double>(panels.size());
  for (const PlotCurve& curve : panels.front().curves) {
    if (curve.name.empty()) continue;
    out += svg::Line(left, row - 4, left + 20, row - 4,
                     fmt::format("stroke=\"{}\" stroke-width=\"1.6\"", curve.colour)) +
           svg::Text(left + 26, row, "start", curve.name);
    row += kLegendRow;
  }
  return out + "</svg>\n";
}

}  // namespace taclink::command
