#include "client/command/offline/marker_map_svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/command/cli/svg.h"

namespace taclink::command {
namespace {

// Pixels.
constexpr double kMapLeft = 60, kMapHead = 50, kMapFoot = 50, kMapWidth = 480, kMapHeight = 300,
                 kScaleGap = 24, kScaleWidth = 16, kScaleText = 80;
constexpr int kScaleSteps = 32;
constexpr const char* kNoValue = "#d0d0d0";

std::string MapColour(double share) {
  return fmt::format("hsl({:.0f},75%,{:.0f}%)", 230 - 200 * share, 35 + 30 * share);
}

struct MapRange {
  double least = INFINITY, most = -INFINITY;

  explicit MapRange(const std::vector<double>& values) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  bool empty() const { return least > most; }
  double Share(double value) const { return most > least ? (value - least) / (most - least) : 0; }
};

std::string Cell(double x, double y, double width, double height, const std::string& fill,
                 const std::string& title) {
  return fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
      "fill=\"{}\"><title>{}</title></rect>\n",
      x, y, width, height, fill, svg::Escaped(title));
}

std::string Scale(const MapRange& range, const std::string& unit) {
  const double left = kMapLeft + kMapWidth + kScaleGap, step = kMapHeight / kScaleSteps;
  std::string out;
  for (int i = 0; i < kScaleSteps; ++i) {
    const double share = (i + 0.5) / kScaleSteps;
    out += Cell(left, kMapHead + kMapHeight - (i + 1) * step, kScaleWidth, step, MapColour(share), "");
  }
  const double text = left + kScaleWidth + 6;
  return out + svg::Text(text, kMapHead + 10, "start", fmt::format("{:.3g} {}", range.most, unit)) +
         svg::Text(text, kMapHead + kMapHeight, "start", fmt::format("{:.3g} {}", range.least, unit));
}

}  // namespace

std::string MarkerMapSvg(const LinkModel& model, const MarkerMapValues& map) {
  const MapRange range(map.values);
  std::string out = svg::Open(kMapLeft + kMapWidth + kScaleGap + kScaleWidth + kScaleText,
                              kMapHead + kMapHeight + kMapFoot) +
                    svg::Text(kMapLeft, 28, "start", map.title, " font-size=\"15\" font-weight=\"bold\"");
  const int paths = model.markers.paths, rings = model.markers.rings();
  const double width = kMapWidth / rings, height = kMapHeight / paths;
  for (int m = 0; m < model.markers.count(); ++m) {
    const double value = map.values[static_cast<size_t>(m)];
    const int path = model.PathOf(m), ring = model.RingOf(m);
    const std::string place = fmt::format("path {}, ring {}: ", path + 1, ring + 1);
    out += Cell(kMapLeft + ring * width, kMapHead + (paths - 1 - path) * height, width, height,
                std::isfinite(value) ? MapColour(range.Share(value)) : kNoValue,
                place + (std::isfinite(value) ? fmt::format("{:.3g} {}", value, map.unit) : "none"));
  }
  const int label_rings = std::max(1, rings / 16), label_paths = std::max(1, paths / 16);
  for (int ring = 0; ring < rings; ring += label_rings)
    out += svg::Text(kMapLeft + (ring + 0.5) * width, kMapHead + kMapHeight + 16, "middle",
                     std::to_string(ring + 1));
  for (int path = 0; path < paths; path += label_paths)
    out += svg::Text(kMapLeft - 6, kMapHead + (paths - 0.5 - path) * height + 4, "end",
                     std::to_string(path + 1));
  out += svg::Text(kMapLeft + kMapWidth / 2, kMapHead + kMapHeight + 38, "middle", "ring");
  const double middle = kMapHead + kMapHeight / 2;
  out += svg::Text(18, middle, "middle", "path", fmt::format(" transform=\"rotate(-90 18 {:.1f})\"", middle));
  out += range.empty() ? svg::Text(kMapLeft + kMapWidth / 2, middle, "middle", "no value anywhere")
                       : Scale(range, map.unit);
  return out + "</svg>\n";
}

}  // namespace taclink::command
