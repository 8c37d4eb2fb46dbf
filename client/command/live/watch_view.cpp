#include "client/command/live/watch_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/command/cli/terminal_style.h"
#include "client/cpp/taclink/values.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using std::chrono::duration;
using std::chrono::steady_clock;

constexpr double kLeastChangeN = 0.05;
constexpr double kRelativeChange = 0.2;
constexpr std::chrono::milliseconds kRateWindow{1000};
constexpr std::chrono::milliseconds kSample{250};
constexpr size_t kSamples = 24;  // six seconds
constexpr int kBarCharacters = 16;
constexpr double kLeastTopN = 0.5;  // of a bar
constexpr size_t kMostContacts = 12;
constexpr const char* kHome = "\x1b[H";
constexpr const char* kClearLine = "\x1b[K\n";
constexpr const char* kClearBelow = "\x1b[J";

std::string Where(const v1::Contact& contact) {
  const v1::Vector3& c = contact.center_m();
  return fmt::format("({:6.1f}, {:6.1f}, {:6.1f}) mm", c.x() * 1e3, c.y() * 1e3, c.z() * 1e3);
}

Color ColorOf(v1::LinkStatus status) {
  if (status == v1::LINK_STATUS_OK) return Color::kGreen;
  return status == v1::LINK_STATUS_LOST ? Color::kRed : Color::kYellow;
}

// Of a scale: the next of 1, 2, 5, 10, ... tenths.
double RoundUp(double value) {
  double top = kLeastTopN;
  for (int step = 0; top < value && std::isfinite(value); ++step) top *= step % 3 == 2 ? 2.5 : 2;
  return top;
}

std::string Force(const v1::Contact& contact) {
  const v1::Vector3& f = contact.force_n();
  return fmt::format("{:5.2f} N ({:5.2f}, {:5.2f}, {:5.2f})", client::MagnitudeN(contact), f.x(), f.y(),
                     f.z());
}

std::string Total(const v1::LinkFrame& frame) {
  const double total_n = client::TotalMagnitudeN(frame);
  return std::isnan(total_n) ? "-" : fmt::format("{:.2f} N", total_n);
}

}  // namespace

void LiveView::Take(const v1::LinkFrame& frame) {
  const auto now = steady_clock::now();
  auto [at, added] = links_.try_emplace(frame.link_index());
  LinkView& view = at->second;
  view.frame = frame;
  view.latency_s = client::LatencyS(frame);
  if (added) view.counted_since = now;
  if (!added && frame.times().exposure_ns() != 0) ++view.frames;
}

void LiveView::Count(LinkView& view, steady_clock::time_point now) const {
  if (now - view.counted_since >= kRateWindow) {
    view.rate_hz = view.frames / duration<double>(now - view.counted_since).count();
    view.counted_since = now;
    view.frames = 0;
  }
  if (now - view.sampled < kSample) return;
  view.sampled = now;
  view.forces_n.push_back(client::TotalMagnitudeN(view.frame));
  if (view.forces_n.size() > kSamples) view.forces_n.pop_front();
}

std::string LiveView::Row(const LinkView& view, size_t name_width, double top_n) const {
  const v1::LinkFrame& frame = view.frame;
  const std::string status = fmt::format("{:<11}", client::Name(frame.status()));
  const std::string bar = Bar(client::TotalMagnitudeN(frame) / top_n, kBarCharacters);
  const std::string latency = view.latency_s ? fmt::format("{:.1f} ms", *view.latency_s * 1e3) : "-";
  return fmt::format("{:<{}}  {} {:>7} {} {:<{}}  {:5.1f}/s {:>8}  {}+{}  {}", Printable(frame.link()),
                     name_width, color_ ? Colored(status, ColorOf(frame.status())) : status, Total(frame),
                     color_ ? Colored(bar, Color::kOrange) : bar, Sparkline(view.forces_n, top_n), kSamples,
                     view.rate_hz, latency, frame.markers_seen(), frame.markers_inferred(),
                     Printable(frame.status_reason()));
}

std::vector<LiveView::Touch> LiveView::TouchesByForce() const {
  std::vector<Touch> touches;
  for (const auto& [index, view] : links_) {
    for (const v1::Contact& contact : view.frame.contacts())
      touches.push_back({&view.frame, &contact, client::MagnitudeN(contact)});
  }
  std::ranges::sort(touches, [](const Touch& a, const Touch& b) { return a.force_n > b.force_n; });
  return touches;
}

std::string LiveView::Draw(const v1::StreamStatus& status, steady_clock::time_point now,
                           const std::vector<std::string>& footer) {
  size_t name_width = 4;
  double largest_n = 0;
  for (auto& [index, view] : links_) {
    Count(view, now);
    name_width = std::max(name_width, view.frame.link().size());
    for (const double force_n : view.forces_n)
      if (force_n > largest_n) largest_n = force_n;
  }
  const double top_n = RoundUp(largest_n);
  std::string out = kHome + (color_ ? Colored(title_, Color::kBold) : title_) + kClearLine;
  out += fmt::format("bars to {:.3g} N{}{}", top_n, kClearLine, kClearLine);
  for (const auto& [index, view] : links_) out += Row(view, name_width, top_n) + kClearLine;
  const std::vector<Touch> touches = TouchesByForce();
  out += kClearLine;
  for (size_t i = 0; i < std::min(touches.size(), kMostContacts); ++i) {
    const Touch& touch = touches[i];
    out += fmt::format("  {:<{}} #{:<4} {}  at {}  area {:.0f} mm2{}", Printable(touch.frame->link()),
                       name_width, touch.contact->id(), Force(*touch.contact), Where(*touch.contact),
                       touch.contact->area_m2() * 1e6, kClearLine);
  }
  if (touches.size() > kMostContacts)
    out += fmt::format("  and {} more{}", touches.size() - kMostContacts, kClearLine);
  uint64_t dropped = 0;
  for (const v1::LinkStreamCounts& link : status.links()) dropped += link.frames_dropped();
  if (dropped > 0) out += fmt::format("{}dropped for this client: {}{}", kClearLine, dropped, kClearLine);
  for (const std::string& line : footer)
    if (!line.empty())
      out += kClearLine + (color_ ? Colored(Printable(line), Color::kDim) : Printable(line)) + kClearLine;
  return out + kClearBelow;
}

std::vector<std::string> ChangeLog::Take(const v1::LinkFrame& frame) {
  std::vector<std::string> lines;
  LinkLog& log = links_[frame.link()];
  if (log.status != frame.status() || log.reason != frame.status_reason()) {
    log.status = frame.status();
    log.reason = frame.status_reason();
    lines.push_back(fmt::format("{} is {}{}{}", frame.link(), client::Name(frame.status()),
                                frame.status_reason().empty() ? "" : ": ", frame.status_reason()));
  }
  std::map<uint64_t, double> now_told;
  for (const auto& contact : frame.contacts()) {
    const double force_n = client::MagnitudeN(contact);
    const auto told = log.told_force_n.find(contact.id());
    const bool is_new = told == log.told_force_n.end();
    const double least = is_new ? 0 : std::max(kLeastChangeN, kRelativeChange * told->second);
    const bool changed = is_new || std::abs(force_n - told->second) > least;
    now_told[contact.id()] = changed ? force_n : told->second;
    if (!changed) continue;
    lines.push_back(fmt::format("{} contact {} {}: {} at {}", frame.link(), contact.id(),
                                is_new ? "begins" : "changes", Force(contact), Where(contact)));
  }
  for (const auto& [id, force_n] : log.told_force_n) {
    if (!now_told.contains(id)) lines.push_back(fmt::format("{} contact {} ends", frame.link(), id));
  }
  log.told_force_n = std::move(now_told);
  return lines;
}

}  // namespace taclink::command
