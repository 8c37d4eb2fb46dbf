#include "client/command/live/watch_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/cpp/taclink/values.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using std::chrono::duration;
using std::chrono::steady_clock;

constexpr double kLeastChangeN = 0.05;
constexpr double kRelativeChange = 0.2;
constexpr std::chrono::milliseconds kRateWindow{1000};
constexpr const char* kHome = "\x1b[H";
constexpr const char* kClearLine = "\x1b[K\n";
constexpr const char* kClearBelow = "\x1b[J";

std::string Where(const v1::Contact& contact) {
  const v1::Vector3& c = contact.center_m();
  return fmt::format("({:6.1f}, {:6.1f}, {:6.1f}) mm", c.x() * 1e3, c.y() * 1e3, c.z() * 1e3);
}

std::string Force(const v1::Contact& contact) {
  const v1::Vector3& f = contact.force_n();
  return fmt::format("{:5.2f} N ({:5.2f}, {:5.2f}, {:5.2f})", client::Norm(f), f.x(), f.y(), f.z());
}

std::string Total(const v1::LinkFrame& frame) {
  return frame.has_total_force_n() ? fmt::format("{:.2f} N", client::Norm(frame.total_force_n())) : "-";
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

std::string LiveView::Draw(const v1::StreamStatus& status, steady_clock::time_point now) {
  std::string out = kHome + title_ + kClearLine;
  for (auto& [index, view] : links_) {
    if (now - view.counted_since >= kRateWindow) {
      view.rate_hz = view.frames / duration<double>(now - view.counted_since).count();
      view.counted_since = now;
      view.frames = 0;
    }
    const v1::LinkFrame& frame = view.frame;
    out += fmt::format("{}{:<14} {:<11} {:5.1f}/s  latency {:>8}  total {:>7}  markers {}+{}  {}{}",
                       kClearLine, Printable(frame.link()), client::Name(frame.status()), view.rate_hz,
                       view.latency_s ? fmt::format("{:.1f} ms", *view.latency_s * 1e3) : "-", Total(frame),
                       frame.markers_seen(), frame.markers_inferred(), Printable(frame.status_reason()),
                       kClearLine);
    for (const auto& contact : frame.contacts()) {
      out += fmt::format("  #{:<4} {}  at {}  area {:.0f} mm2{}", contact.id(), Force(contact),
                         Where(contact), contact.area_m2() * 1e6, kClearLine);
    }
  }
  uint64_t dropped = 0;
  for (const v1::LinkStreamCounts& link : status.links()) dropped += link.frames_dropped();
  if (dropped > 0) out += fmt::format("{}dropped for this client: {}{}", kClearLine, dropped, kClearLine);
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
    const double force_n = client::Norm(contact.force_n());
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
