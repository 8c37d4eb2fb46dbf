#include "bench/vision/error_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "bench/vision/vision_report.h"
#include "sensing/core/geometry.h"

namespace taclink {
namespace {

constexpr double kWidth = 760, kHeight = 460, kLeft = 80, kRight = 190, kTop = 30, kBottom = 60;
constexpr std::array<const char*, 6> kColours = {"#1b6ca8", "#d1495b", "#2e8b57",
                                                 "#8a5fbf", "#c77d0a", "#555555"};

// A decade axis that holds all values.
struct LogAxis {
  int low = 0, high = 1;

  explicit LogAxis(const std::vector<double>& values) {
    const auto [least, most] = std::minmax_element(values.begin(), values.end());
    low = static_cast<int>(std::floor(std::log10(*least)));
    high = std::max(low + 1, static_cast<int>(std::ceil(std::log10(*most))));
  }
  double Share(double value) const { return (std::log10(value) - low) / (high - low); }
};

std::string Format(const char* format, double a, double b, double c = 0, double d = 0) {
  char text[256];
  std::snprintf(text, sizeof text, format, a, b, c, d);  // NOLINT(clang-diagnostic-format-nonliteral)
  return text;
}

std::string Text(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
  return Format("<text x=\"%.1f\" y=\"%.1f\"", x, y) + " text-anchor=\"" + anchor + "\"" + more + ">" + text +
         "</text>\n";
}

struct Box {
  double left, top, right, bottom;

  bool Meets(const Box& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
};

// Beside a point, where it covers nothing that is there already.
Box PlaceLabel(double x, double y, size_t letters, const std::vector<Box>& taken) {
  const double width = 6.2 * static_cast<double>(letters), height = 15;
  const std::array<Vec2, 6> corners = {Vec2(x + 8, y - height / 2),
                                       Vec2(x - 8 - width, y - height / 2),
                                       Vec2(x - width / 2, y - 8 - height),
                                       Vec2(x - width / 2, y + 8),
                                       Vec2(x + 4, y + 10),
                                       Vec2(x + 4, y - 10 - height)};
  for (const Vec2& corner : corners) {
    const Box box{corner.x(), corner.y(), corner.x() + width, corner.y() + height};
    const bool free = std::none_of(taken.begin(), taken.end(), [&](const Box& other) {
      return box.Meets(other) && !(other.left < x && x < other.right && other.top < y && y < other.bottom);
    });
    if (free && box.left > kLeft) return box;
  }
  return {corners[0].x(), corners[0].y(), corners[0].x() + width, corners[0].y() + height};
}

std::string Plain(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::vector<PlotPoint> Points(const std::vector<SceneOutcome>& outcomes,
                              const std::vector<VisionMethodKind>& methods) {
  std::vector<std::string> models;
  for (const SceneOutcome& o : outcomes) {
    if (std::find(models.begin(), models.end(), o.model) == models.end()) models.push_back(o.model);
  }
  std::vector<PlotPoint> points;
  for (size_t i = 0; i < methods.size(); ++i) {
    for (const std::string& model : models) {
      const VisionScore s = SumScores(outcomes, i, [&](const SceneOutcome& o) { return o.model == model; });
      const double time = Percentile(s.times.vision, 0.5), error = s.position[2].Rms(ErrorAxis::k3d);
      if (time > 0 && error > 0) points.push_back({time, error, i, methods[i].name + ", " + model});
    }
  }
  return points;
}

}  // namespace

std::string LogPlot(const std::vector<PlotPoint>& points, const std::string& x_label,
                    const std::string& y_label) {
  std::string svg =
      Format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" ", kWidth, kHeight) +
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"white\"/>\n";
  if (points.empty())
    return svg + Text(kWidth / 2, kHeight / 2, "middle", "nothing was measured") + "</svg>\n";
  std::vector<double> times, errors;
  for (const PlotPoint& p : points) {
    times.push_back(p.x);
    errors.push_back(p.y);
  }
  const LogAxis x(times), y(errors);
  const auto at_x = [&](double v) { return kLeft + x.Share(v) * (kWidth - kLeft - kRight); };
  const auto at_y = [&](double v) { return kHeight - kBottom - y.Share(v) * (kHeight - kTop - kBottom); };
  const auto grid = [&](const LogAxis& axis, const auto& draw) {
    for (int decade = axis.low; decade <= axis.high; ++decade) {
      for (const double step : {1.0, 2.0, 5.0}) {
        const double value = step * std::pow(10, decade);
        if (axis.Share(value) <= 1 + 1e-9) draw(value, step == 1.0 ? "#aaa" : "#e4e4e4");
      }
    }
  };
  const char* line = "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"";
  grid(x, [&](double v, const char* colour) {
    svg += Format(line, at_x(v), kTop, at_x(v), kHeight - kBottom) + colour + "\"/>\n";
    svg += Text(at_x(v), kHeight - kBottom + 16, "middle", Plain(v));
  });
  grid(y, [&](double v, const char* colour) {
    svg += Format(line, kLeft, at_y(v), kWidth - kRight, at_y(v)) + colour + "\"/>\n";
    svg += Text(kLeft - 6, at_y(v) + 4, "end", Plain(v));
  });
  svg += Text((kLeft + kWidth - kRight) / 2, kHeight - 16, "middle", x_label);
  const std::string turned = Format(" transform=\"rotate(-90 %.1f %.1f)\"", 20, kHeight / 2);
  svg += Text(20, kHeight / 2, "middle", y_label, turned.c_str());
  std::vector<Box> taken;
  taken.reserve(2 * points.size());
  for (const PlotPoint& p : points)
    taken.push_back({at_x(p.x) - 6, at_y(p.y) - 6, at_x(p.x) + 6, at_y(p.y) + 6});
  for (const PlotPoint& p : points) {
    const std::string colour = kColours[p.series % kColours.size()];
    svg +=
        Format("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"5\" fill=\"", at_x(p.x), at_y(p.y)) + colour + "\"/>\n";
    const Box box = PlaceLabel(at_x(p.x), at_y(p.y), p.label.size(), taken);
    taken.push_back(box);
    svg += Text(box.left, box.bottom - 4, "start", p.label, (" fill=\"" + colour + "\"").c_str());
  }
  return svg + "</svg>\n";
}

std::string ErrorTimePlot(const std::vector<SceneOutcome>& outcomes,
                          const std::vector<VisionMethodKind>& methods) {
  return LogPlot(Points(outcomes, methods),
                 "CPU time of detection, labels and shape per stereo pair, median, ms",
                 "RMSE of marker positions, 3-D, mm");
}

}  // namespace taclink
