#include "server/gateway/arm_metrics.h"

#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace taclink::server {
namespace {

constexpr std::array<std::string_view, 5> kStatusNames = {"starting", "calibrating", "ok", "degraded",
                                                          "lost"};  // as LinkStatus

constexpr std::array<std::string_view, 4> kSupervisionNames = {"running", "overdue", "restarting",
                                                               "resting"};  // as Supervision::State

// One family: `of` gives a link's value.
template <typename Function>
void AddEach(const Arm& arm, MetricsText& family, const Function& of) {
  for (size_t link = 0; link < arm.links().size(); ++link)
    family.Value(static_cast<double>(of(link)), {{"link", arm.links()[link].name}});
}

void AddStatus(const Arm& arm, MetricsText& metrics) {
  metrics.Gauge("taclink_link_status", "1 for the status that the link has");
  for (size_t link = 0; link < arm.links().size(); ++link) {
    const auto latest = arm.hub().Latest(link);
    const auto now = static_cast<size_t>(latest ? latest->state().status : LinkStatus::kStarting);
    for (size_t status = 0; status < kStatusNames.size(); ++status)
      metrics.Value(status == now ? 1 : 0,
                    {{"link", arm.links()[link].name}, {"status", std::string(kStatusNames[status])}});
  }
}

void AddSupervision(const Arm& arm, MetricsText& metrics) {
  std::vector<Supervision> workers;
  for (size_t link = 0; link < arm.links().size(); ++link) workers.push_back(arm.worker(link).supervision());
  metrics.Gauge("taclink_link_supervision", "1 for how the watchdog finds the link's worker");
  for (size_t link = 0; link < workers.size(); ++link) {
    for (size_t state = 0; state < kSupervisionNames.size(); ++state)
      metrics.Value(state == static_cast<size_t>(workers[link].state) ? 1 : 0,
                    {{"link", arm.links()[link].name}, {"state", std::string(kSupervisionNames[state])}});
  }
  AddEach(arm, metrics.Counter("taclink_link_worker_restarts_total", "Workers after the first"),
          [&](size_t link) { return workers[link].restarts; });
  AddEach(arm, metrics.Counter("taclink_link_stage_overruns_total", "Stages that took longer than they may"),
          [&](size_t link) { return workers[link].overruns; });
  AddEach(arm, metrics.Counter("taclink_link_workers_abandoned_total", "Workers that hung and were given up"),
          [&](size_t link) { return workers[link].abandoned; });
}

// One family over the cameras of all links that have any.
void AddCameras(const Arm& arm, const std::vector<SourceCondition>& sources, MetricsText& family,
                const std::array<uint64_t, kCameraCount> SourceCounters::* counter) {
  for (size_t link = 0; link < sources.size(); ++link) {
    for (size_t camera = 0; camera < sources[link].info.cameras.size() && camera < kCameraCount; ++camera)
      family.Value(static_cast<double>((sources[link].counters.*counter)[camera]),
                   {{"link", arm.links()[link].name}, {"camera", Name(kBothCameras[camera])}});
  }
}

void AddHistograms(const Arm& arm, MetricsText& metrics) {
  constexpr std::array<std::pair<const char*, LatencyHistogram LinkHistograms::*>, 6> kStages = {
      {{"capture", &LinkHistograms::capture},
       {"decode", &LinkHistograms::decode},
       {"detect", &LinkHistograms::detect},
       {"register", &LinkHistograms::register_},
       {"reconstruct", &LinkHistograms::reconstruct},
       {"force", &LinkHistograms::force}}};
  metrics.Histogram("taclink_link_latency_seconds", "From a frame's exposure to its publication");
  for (size_t link = 0; link < arm.links().size(); ++link)
    metrics.Value(arm.worker(link).histograms().latency.Read(), {{"link", arm.links()[link].name}});
  metrics.Histogram("taclink_link_stage_seconds", "What each stage of a frame took");
  for (size_t link = 0; link < arm.links().size(); ++link) {
    for (const auto& [name, stage] : kStages)
      metrics.Value((arm.worker(link).histograms().*stage).Read(),
                    {{"link", arm.links()[link].name}, {"stage", name}});
  }
}

}  // namespace

void AddArmMetrics(const Arm& arm, MetricsText& metrics) {
  std::vector<LinkStatistics> statistics;
  std::vector<SourceCondition> sources;
  for (size_t link = 0; link < arm.links().size(); ++link) {
    statistics.push_back(arm.worker(link).Statistics());
    sources.push_back(arm.worker(link).source_condition());
  }
  AddEach(arm, metrics.Counter("taclink_link_frames_total", "Frames solved"),
          [&](size_t link) { return statistics[link].frames; });
  AddEach(arm, metrics.Counter("taclink_link_frames_skipped_total", "Frames exposed but not solved"),
          [&](size_t link) { return statistics[link].frames_skipped; });
  AddEach(arm, metrics.Gauge("taclink_link_rate_hertz", "Frames solved a second, over the last 2 s"),
          [&](size_t link) { return statistics[link].rate_hz; });
  AddEach(arm, metrics.Counter("taclink_link_source_restarts_total", "Starts of the source after the first"),
          [&](size_t link) { return sources[link].restarts; });
  AddEach(arm, metrics.Gauge("taclink_link_contacts", "Contacts in the newest frame; NaN: not known"),
          [&](size_t link) {
            const auto latest = arm.hub().Latest(link);
            return latest && latest->state().has_forces()
                       ? static_cast<double>(latest->state().contacts.size())
                       : std::nan("");
          });
  AddEach(arm,
          metrics.Gauge("taclink_link_total_magnitude_newtons",
                        "Sum of the contacts' magnitudes; NaN: not known"),
          [&](size_t link) {
            const auto latest = arm.hub().Latest(link);
            return latest ? latest->state().total_magnitude_n() : std::nan("");
          });
  AddStatus(arm, metrics);
  AddSupervision(arm, metrics);
  AddCameras(arm, sources, metrics.Counter("taclink_camera_pictures_total", "Pictures that came whole"),
             &SourceCounters::pictures);
  AddCameras(arm, sources,
             metrics.Counter("taclink_camera_lost_pictures_total",
                             "Pictures that the camera counted but did not deliver"),
             &SourceCounters::lost);
  AddCameras(arm, sources,
             metrics.Counter("taclink_camera_damaged_pictures_total", "Pictures that came damaged"),
             &SourceCounters::damaged);
  AddHistograms(arm, metrics);
  const HubTotals totals = arm.hub().Totals();
  metrics.Gauge("taclink_subscribers", "Receivers of frames").Value(static_cast<double>(totals.subscribers));
  metrics.Gauge("taclink_subscriber_queue_frames", "Frames that wait for receivers, all together")
      .Value(static_cast<double>(totals.waiting));
  metrics.Counter("taclink_subscriber_dropped_frames_total", "Frames that receivers were too slow for")
      .Value(static_cast<double>(totals.dropped));
}

}  // namespace taclink::server
