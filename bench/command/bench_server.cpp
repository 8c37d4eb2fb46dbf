#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/benchmarks.h"
#include "bench/server/server_load.h"
#include "bench/vision/error_plot.h"
#include "bench/vision/vision_report.h"
#include "client/command/cli/json.h"

namespace taclink::command {
namespace {

constexpr v1::Detail kDetails[] = {v1::DETAIL_CONTACTS, v1::DETAIL_GEOMETRY, v1::DETAIL_FULL};

struct BenchServerOptions {
  bool quick = false;
  double seconds = 10;
  ServerLoad one = {.links = 0};  // no links: the whole program
  std::string detail = "full";
  std::string taclinkd;
  std::string publish;  // URL of a NATS server; empty: none
  std::string json, markdown, svg;
};

/// Loads that one table shows, and how the plot calls its curve.
struct Series {
  std::string title, curve;
  std::vector<ServerLoad> loads;
};

std::vector<Series> AllSeries(bool quick) {
  std::vector<Series> all = {
      {"Targets", "", {{6, 30, 32}, {16, 30, 1}, {4, 120, 1}}},
      {"More links, one client", "links, 1 client", {}},
      {"More clients, 6 links", "clients, 6 links", {}},
      {"Detail, 6 links and 32 clients", "", {}},
  };
  for (const int links : quick ? std::vector<int>{1, 4} : std::vector<int>{1, 2, 4, 8, 16})
    all[1].loads.push_back({.links = links});
  for (const int clients : quick ? std::vector<int>{1, 8} : std::vector<int>{1, 2, 4, 8, 16, 32, 64})
    all[2].loads.push_back({.links = 6, .clients = clients});
  for (const v1::Detail detail : kDetails)
    all[3].loads.push_back({.links = 6, .clients = quick ? 8 : 32, .detail = detail});
  return all;
}

std::string Number(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);  // NOLINT(clang-diagnostic-format-nonliteral)
  return text;
}

double Asked(const ServerLoad& load) {
  return load.links * load.rate_hz * load.clients;
}

ReportTable Table(const std::string& title, const std::vector<LoadResult>& results) {
  ReportTable table{
      title,
      {"links", "rate, 1/s", "clients", "detail", "frames/s", "of asked", "skipped", "dropped",
       "exposure to client p50, ms", "p99, ms", "memory to client p50, ms", "p99, ms", "stages p99, ms",
       "beside them p99, ms", "server, cores", "clients, cores", "others, cores", "server, MB"},
      {}};
  for (const LoadResult& r : results) {
    const double rate = static_cast<double>(r.received) / r.seconds;
    table.rows.push_back(
        {std::to_string(r.load.links), Number("%g", r.load.rate_hz), std::to_string(r.load.clients),
         client::Name(r.load.detail), Number("%.0f", rate), Number("%.1f %%", 100 * rate / Asked(r.load)),
         std::to_string(r.skipped), std::to_string(r.dropped), Number("%.1f", r.exposure_p50_ms),
         Number("%.1f", r.exposure_p99_ms), Number("%.1f", r.memory_p50_ms), Number("%.1f", r.memory_p99_ms),
         Number("%.1f", r.stages_p99_ms), Number("%.1f", r.beside_p99_ms), Number("%.2f", r.server_cores),
         Number("%.2f", r.clients_cores), Number("%.2f", r.other_cores), Number("%.0f", r.server_mb)});
  }
  return table;
}

Json LoadJson(const LoadResult& r) {
  return {{"links", r.load.links},
          {"rate_hz", r.load.rate_hz},
          {"clients", r.load.clients},
          {"detail", client::Name(r.load.detail)},
          {"seconds", r.seconds},
          {"received", r.received},
          {"skipped", r.skipped},
          {"dropped", r.dropped},
          {"exposure_to_client_ms", {{"p50", r.exposure_p50_ms}, {"p99", r.exposure_p99_ms}}},
          {"memory_to_client_ms", {{"p50", r.memory_p50_ms}, {"p99", r.memory_p99_ms}}},
          {"stages_p99_ms", r.stages_p99_ms},
          {"beside_p99_ms", r.beside_p99_ms},
          {"server_cores", r.server_cores},
          {"clients_cores", r.clients_cores},
          {"other_cores", r.other_cores},
          {"server_mb", r.server_mb}};
}

// Loads of the same links and rate share a server, in the order given.
Result<std::vector<LoadResult>> RunBenchServer(const std::vector<ServerLoad>& loads,
                                               const LoadPictures& pictures,
                                               const BenchServerOptions& options) {
  std::vector<LoadResult> results;
  for (size_t begin = 0; begin < loads.size();) {
    size_t end = begin;
    while (end < loads.size() && loads[end].links == loads[begin].links &&
           std::abs(loads[end].rate_hz - loads[begin].rate_hz) < 1e-9)
      ++end;
    const std::vector<ServerLoad> group(loads.begin() + static_cast<std::ptrdiff_t>(begin),
                                        loads.begin() + static_cast<std::ptrdiff_t>(end));
    const std::string more =
        options.publish.empty() ? "" : "publish: {url: \"" + options.publish + "\", site: bench}\n";
    auto measured = MeasureLoads(group, pictures, options.taclinkd, options.seconds, more);
    if (!measured) return measured.error();
    results.insert(results.end(), measured->begin(), measured->end());
    begin = end;
  }
  return results;
}

std::string Settings(const BenchServerOptions& options) {
  return "Machine of " + std::to_string(std::thread::hardware_concurrency()) + " cores; " +
         Number("%g", options.seconds) + " s for each row.\n\n";
}

std::vector<Series> ChooseSeries(const BenchServerOptions& options) {
  if (options.one.links == 0) return AllSeries(options.quick);
  ServerLoad load = options.one;
  load.detail = *client::ValueOf<v1::Detail>(options.detail);
  return {{"One load", "", {load}}};
}

Result<void> Server(BenchServerOptions options) {
  if (auto good = CheckWritable({options.markdown, options.svg, options.json}); !good) return good;
  if (options.quick) options.seconds = std::min(options.seconds, 3.0);
  const auto scratch = Scratch::Make({});
  if (!scratch) return scratch.error();
  const auto pictures = RenderLoadPictures(scratch->path.string());
  if (!pictures) return pictures.error();
  std::string markdown = Settings(options);
  std::printf("%s", markdown.c_str());
  Json json = Json::array();
  std::vector<PlotPoint> points;
  size_t curve = 0;
  for (const Series& series : ChooseSeries(options)) {
    const auto results = RunBenchServer(series.loads, *pictures, options);
    if (!results) return results.error();
    const ReportTable table = Table(series.title, *results);
    std::printf("%s\n", AlignedText(table).c_str());
    std::fflush(stdout);
    markdown += Markdown(table) + "\n";
    for (const LoadResult& result : *results) {
      json.push_back(LoadJson(result));
      if (series.curve.empty()) continue;
      const int x = curve == 0 ? result.load.links : result.load.clients;
      const bool last = &result == &results->back();
      points.push_back({static_cast<double>(x), result.memory_p99_ms, curve, last ? series.curve : ""});
    }
    curve += series.curve.empty() ? 0 : 1;
  }
  if (auto written = WriteBetweenMarks(options.markdown, "taclink-bench server", markdown); !written)
    return written.error();
  if (!options.svg.empty() && !points.empty()) {
    const std::string plot = LogPlot(points, "links, clients", "memory to client, p99, ms");
    if (auto written = WriteText(options.svg, plot); !written) return written.error();
  }
  return WriteText(options.json, options.json.empty() ? "" : json.dump(1) + "\n");
}

}  // namespace

void AddBenchServer(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchServerOptions>();
  const Arguments server = bench.AddCommand(
      "server", "A server of its own under links x clients x detail: rates, drops, latency, CPU, memory");
  server.AddFlag("--quick", options->quick, "Fewer rows of 3 s");
  server.AddOption("--seconds", options->seconds, "Of each measurement").Must(Within(0.5, 600)).ShowDefault();
  const Option links =
      server.AddOption("--links", options->one.links, "One load only: so many links").Must(Between(1, 64));
  server.AddOption("--clients", options->one.clients, "Of the one load")
      .Must(Between(1, 1000))
      .Needs(links)
      .ShowDefault();
  server.AddOption("--rate", options->one.rate_hz, "Frames a second of each link of the one load")
      .Must(Within(1, 1000))
      .Needs(links)
      .ShowDefault();
  server.AddOption("--detail", options->detail, "Of the one load: contacts, geometry or full")
      .Must(OneOf(client::Names<v1::Detail>()))
      .Needs(links)
      .ShowDefault();
  server.AddOption("--taclinkd", options->taclinkd, "The server's program (the one beside this)");
  server.AddOption("--publish", options->publish, "URL of a NATS server to which the server publishes");
  server.AddOption("--json", options->json, "File for all numbers");
  server.AddOption("--markdown", options->markdown,
                   "File for the tables, or a page with marks to put them between");
  server.AddOption("--svg", options->svg, "File for the plot of latency against links and clients");
  server.OnChosen([options, &selected] { selected = [options] { return Server(*options); }; });
}

}  // namespace taclink::command
