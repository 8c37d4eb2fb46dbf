#pragma once

#include <prometheus/metric_family.h>

#include <string>
#include <vector>

#include "server/link/latency_histogram.h"

namespace taclink::server {

/// Families of metrics, made again at each scrape.
class MetricsText {
 public:
  using Labels = std::vector<prometheus::ClientMetric::Label>;

  /// Begins a family; the values that follow are its.
  MetricsText& Gauge(std::string name, std::string help);
  MetricsText& Counter(std::string name, std::string help);
  MetricsText& Histogram(std::string name, std::string help);

  MetricsText& Value(double value, Labels labels = {});
  /// In seconds.
  MetricsText& Value(const LatencyHistogram::Snapshot& snapshot, Labels labels);

  /// In Prometheus' text format.
  std::string Text() const;

 private:
  MetricsText& Begin(std::string name, std::string help, prometheus::MetricType type);

  std::vector<prometheus::MetricFamily> families_;
};

}  // namespace taclink::server
