#include "server/gateway/metrics_text.h"

#include <prometheus/text_serializer.h>

#include <limits>
#include <utility>

namespace taclink::server {

MetricsText& MetricsText::Begin(std::string name, std::string help, prometheus::MetricType type) {
  prometheus::MetricFamily family;
  family.name = std::move(name);
  family.help = std::move(help);
  family.type = type;
  families_.push_back(std::move(family));
  return *this;
}

MetricsText& MetricsText::Gauge(std::string name, std::string help) {
  return Begin(std::move(name), std::move(help), prometheus::MetricType::Gauge);
}

MetricsText& MetricsText::Counter(std::string name, std::string help) {
  return Begin(std::move(name), std::move(help), prometheus::MetricType::Counter);
}

MetricsText& MetricsText::Histogram(std::string name, std::string help) {
  return Begin(std::move(name), std::move(help), prometheus::MetricType::Histogram);
}

MetricsText& MetricsText::Value(double value, Labels labels) {
  prometheus::ClientMetric metric;
  metric.label = std::move(labels);
  metric.counter.value = metric.gauge.value = value;  // the family's type says which is written
  families_.back().metric.push_back(std::move(metric));
  return *this;
}

MetricsText& MetricsText::Value(const LatencyHistogram::Snapshot& snapshot, Labels labels) {
  constexpr double kSecondsPerMs = 1e-3;
  prometheus::ClientMetric metric;
  metric.label = std::move(labels);
  uint64_t below = 0;
  for (size_t i = 0; i < snapshot.counts.size(); ++i) {
    below += snapshot.counts[i];
    const bool last = i == LatencyHistogram::kBoundsMs.size();
    const double bound_s =
        last ? std::numeric_limits<double>::infinity() : LatencyHistogram::kBoundsMs[i] * kSecondsPerMs;
    metric.histogram.bucket.push_back({below, bound_s});
  }
  metric.histogram.sample_count = below;
  metric.histogram.sample_sum = snapshot.sum_ms * kSecondsPerMs;
  families_.back().metric.push_back(std::move(metric));
  return *this;
}

std::string MetricsText::Text() const {
  return prometheus::TextSerializer().Serialize(families_);
}

}  // namespace taclink::server
