#include "client/command/logs/force_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "client/command/cli/svg.h"

namespace taclink::command {
namespace {

// Pixels.
constexpr double kWidth = 1000, kLeft = 70, kRight = 20, kHead = 76, kFoot = 52;
constexpr double kPanelTop = 26, kCurves = 150, kMarkStrip = 24,
                 kPanel = kPanelTop + kCurves + kMarkStrip + 6;
constexpr double kPlotWidth = kWidth - kLeft - kRight;
constexpr int kColumns = static_cast<int>(kPlotWidth);
constexpr std::array<const char*, 6> kColours = {"#d1495b", "#2e8b57", "#8a5fbf",
                                                 "#c77d0a", "#008b9a", "#7a5c3e"};
constexpr const char* kTotalStyle = "stroke=\"#1b3c68\" stroke-width=\"1.6\"";
constexpr const char* kBeginStyle = "fill=\"#2e8b57\"";
constexpr const char* kEndStyle = "fill=\"white\" stroke=\"#d1495b\"";

/// Of a contact's begin: points up; of its end: points down.
std::string Mark(double x, double top, bool begin) {
  constexpr double kHalf = 4, kHeight = 8;
  const double tip = begin ? top : top + kHeight, base = begin ? top + kHeight : top;
  return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} {:.1f}Z\" {}/>\n",
                     begin ? "begin" : "end", x, tip, x - kHalf, base, x + kHalf, base,
                     begin ? kBeginStyle : kEndStyle);
}

}  // namespace

/// Where a panel is, and its forces.
struct ForcePlot::Place {
  double top = 0;  // of the curves
  double low = 0, high = 1, step = 1;

  Place(double curves_top, double least, double most) : top(curves_top) {
    step = svg::TickStep(std::max(most - least, 1e-6), 5);
    high = std::max(std::ceil(most / step - 1e-9), 1.0) * step;
    constexpr double kMargin =
        1.05;  // forces seldom are negative, and then by little: no whole step for them
    low = std::max(std::floor(least / step) * step, kMargin * least);
  }
  double bottom() const { return top + kCurves; }
  double Y(double force) const { return bottom() - (force - low) / (high - low) * kCurves; }
};

ForcePlot::ForcePlot(std::string title, double start_s, double end_s)
    : title_(std::move(title)), start_s_(start_s), end_s_(end_s) {}

Trace ForcePlot::NewTrace() const {
  return {start_s_, end_s_, kColumns};
}

ForcePlot::Panel& ForcePlot::PanelOf(const std::string& link) {
  return panels_.try_emplace(link, NewTrace()).first->second;
}

double ForcePlot::XOf(double time_s) const {
  return kLeft + (time_s - start_s_) / (end_s_ - start_s_) * kPlotWidth;
}

int ForcePlot::ColumnOf(double time_s) const {
  return static_cast<int>(std::clamp(XOf(time_s) - kLeft, 0.0, kPlotWidth));
}

void ForcePlot::AddFrame(const std::string& link, double time_s, std::optional<double> total_n,
                         const std::vector<ContactForce>& contacts) {
  Panel& panel = PanelOf(link);
  if (++panel.frames == kExactFrames + 1) {
    panel.total.Decimate();
    for (auto& [id, contact] : panel.contacts) contact.trace.Decimate();
  }
  const auto add = [&](Trace& trace, double force_n) {
    trace.Add(time_s, force_n);
    if (!std::isfinite(force_n)) return;
    panel.least = std::min(panel.least, force_n);
    panel.most = std::max(panel.most, force_n);
  };
  add(panel.total, total_n.value_or(NAN));
  for (const ContactForce& contact : contacts) {
    auto known = panel.contacts.find(contact.id);
    if (known == panel.contacts.end()) {
      if (panel.contacts.size() >= kMostContacts) {
        if (panel.not_drawn.size() < kMostContacts) panel.not_drawn.insert(contact.id);
        continue;
      }
      known = panel.contacts.emplace(contact.id, ContactTrace{.trace = NewTrace()}).first;
      if (panel.frames > kExactFrames) known->second.trace.Decimate();
    }
    if (known->second.last_frame + 1 != panel.frames) known->second.trace.Add(time_s, NAN);
    known->second.last_frame = panel.frames;
    add(known->second.trace, contact.magnitude_n);
  }
}

void ForcePlot::AddContactBegin(const std::string& link, double time_s) {
  marks_[link].begins.insert(ColumnOf(time_s));
}

void ForcePlot::AddContactEnd(const std::string& link, double time_s) {
  marks_[link].ends.insert(ColumnOf(time_s));
}

std::string ForcePlot::Head(double height) const {
  constexpr double kLegend = 48;
  std::string svg = svg::Open(kWidth, height);
  svg += svg::Text(kLeft, 24, "start", title_, " font-size=\"15\" font-weight=\"bold\"");
  double x = kLeft;
  svg += svg::Line(x, kLegend - 4, x + 24, kLegend - 4, kTotalStyle) +
         svg::Text(x + 30, kLegend, "start", "total force");
  x += 130;
  for (size_t i = 0; i < 3; ++i) {
    const double left = x + 9 * static_cast<double>(i);
    svg += svg::Line(left, kLegend - 4, left + 8, kLegend - 4, fmt::format("stroke=\"{}\"", kColours[i]));
  }
  svg += svg::Text(x + 32, kLegend, "start", "normal force of each contact");
  x += 230;
  svg += Mark(x, kLegend - 9, true) + svg::Text(x + 10, kLegend, "start", "a contact begins");
  x += 140;
  return svg + Mark(x, kLegend - 9, false) + svg::Text(x + 10, kLegend, "start", "a contact ends");
}

std::string ForcePlot::TimeAxis(const Place& place, bool labelled) const {
  std::string svg;
  const double step = svg::TickStep(end_s_ - start_s_, 12);
  for (const double time_s : svg::Ticks(start_s_, end_s_, step)) {
    const double x = XOf(time_s), bottom = place.bottom() + kMarkStrip;
    svg += svg::Line(x, place.top, x, bottom, "stroke=\"#e4e4e4\"");
    if (labelled) svg += svg::Text(x, bottom + 16, "middle", svg::TickText(time_s, step));
  }
  if (labelled)
    svg += svg::Text(kLeft + kPlotWidth / 2, place.bottom() + kMarkStrip + 36, "middle",
                     "time since the log's start, s");
  return svg;
}

std::string ForcePlot::ForceAxis(const Place& place) const {
  std::string svg;
  for (const double force : svg::Ticks(place.low, place.high, place.step)) {
    const double y = place.Y(force);
    svg += svg::Line(kLeft, y, kWidth - kRight, y,
                     std::abs(force) < 1e-12 ? "stroke=\"#999\"" : "stroke=\"#e4e4e4\"");
    svg += svg::Text(kLeft - 6, y + 4, "end", svg::TickText(force, place.step));
  }
  const double middle = place.top + kCurves / 2;
  return svg + svg::Text(20, middle, "middle", "force, N",
                         fmt::format(" transform=\"rotate(-90 20 {:.1f})\"", middle));
}

std::string ForcePlot::Curve(const Trace& trace, const Place& place, const std::string& style) const {
  const std::vector<Trace::Point> points = trace.Points();
  if (points.empty()) return {};
  std::string path;
  for (const Trace::Point& point : points)
    path += fmt::format("{}{:.2f} {:.2f}", point.begins ? 'M' : 'L', XOf(point.time_s), place.Y(point.value));
  // A round end makes a single point visible.
  return fmt::format(
      "<path d=\"{}h0\" fill=\"none\" stroke-linejoin=\"round\" stroke-linecap=\"round\" {}/>\n", path,
      style);
}

std::string ForcePlot::MarksOf(const std::string& link, const Place& place) const {
  const auto marks = marks_.find(link);
  if (marks == marks_.end()) return {};
  std::string svg;
  constexpr double kRow = 10;  // begins above ends, so that none covers the other
  const double top = place.bottom() + 3;
  for (const int column : marks->second.begins) svg += Mark(kLeft + column, top, true);
  for (const int column : marks->second.ends) svg += Mark(kLeft + column, top + kRow, false);
  return svg;
}

std::string ForcePlot::Draw(const std::string& link, const Panel& panel, const Place& place,
                            bool last) const {
  std::string svg = "<g class=\"link\">\n" + TimeAxis(place, last) + ForceAxis(place);
  std::string name = link;
  if (!panel.not_drawn.empty())
    name += fmt::format(" ({}{} more contacts are not drawn; cut the log)",
                        panel.not_drawn.size() == kMostContacts ? "at least " : "", panel.not_drawn.size());
  svg += svg::Text(kLeft, place.top - 8, "start", name, " font-weight=\"bold\"");
  if (panel.total.empty())
    svg += svg::Text(kLeft + kPlotWidth / 2, place.top + kCurves / 2, "middle", "nothing was measured");
  for (const auto& [id, contact] : panel.contacts)
    svg += Curve(contact.trace, place,
                 fmt::format("class=\"contact\" stroke=\"{}\"", kColours[id % kColours.size()]));
  svg += Curve(panel.total, place, std::string("class=\"total\" ") + kTotalStyle);
  return svg + MarksOf(link, place) + "</g>\n";
}

std::string ForcePlot::Svg() const {
  std::string svg = Head(kHead + kPanel * static_cast<double>(panels_.size()) + kFoot);
  size_t done = 0;
  for (const auto& [link, panel] : panels_) {
    const Place place(kHead + kPanel * static_cast<double>(done) + kPanelTop, panel.least, panel.most);
    svg += Draw(link, panel, place, ++done == panels_.size());
  }
  return svg + "</svg>\n";
}

}  // namespace taclink::command
