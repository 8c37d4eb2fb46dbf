#include "server/config/config_operations.h"

#include <cmath>
#include <filesystem>

namespace taclink::server {
namespace {

constexpr Range kRates{.min = 0, .max = 1'000'000};

}  // namespace

LogOptions ReadLog(YamlMap& root) {
  LogOptions options;
  YamlMap map = root.Map("log");
  options.level = kLogLevels[map.Choice("level", {kLogLevels.begin(), kLogLevels.end()}, 1)];
  options.format = map.Choice("format", {"text", "json"}, 0) == 0 ? LogFormat::kText : LogFormat::kJson;
  options.file = map.Text("file", options.file);
  if (!options.file.empty() && !std::filesystem::path(options.file).is_absolute())
    map.Fail("file", "must be an absolute path");
  options.rates.per_site = map.Integer("rate_limit", options.rates.per_site, kRates);
  options.rates.total = map.Integer("rate_limit_total", options.rates.total, kRates);
  map.Done();
  return options;
}

void WriteLog(std::ostream& out, const LogOptions& options) {
  out << "log:\n  level: " << options.level
      << "\n  format: " << (options.format == LogFormat::kJson ? "json" : "text") << "\n";
  if (!options.file.empty()) {
    out << "  file: \"";
    for (const char c : options.file) out << (c == '"' || c == '\\' ? "\\" : "") << c;
    out << "\"\n";
  }
  out << "  rate_limit: " << options.rates.per_site << "\n  rate_limit_total: " << options.rates.total
      << "\n";
}

ShutdownConfig ReadShutdown(YamlMap& root) {
  ShutdownConfig config;
  YamlMap map = root.Map("shutdown");
  const double limit_s =
      map.Number("limit_s", 1e-3 * static_cast<double>(config.limit.count()), {.min = 0, .max = 600});
  config.limit = std::chrono::milliseconds(std::lround(1e3 * limit_s));
  map.Done();
  return config;
}

void WriteShutdown(std::ostream& out, const ShutdownConfig& config) {
  out << "shutdown:\n  limit_s: " << 1e-3 * static_cast<double>(config.limit.count()) << "\n";
}

}  // namespace taclink::server
