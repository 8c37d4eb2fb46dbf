#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "bench/command/bench_files.h"
#include "bench/command/benchmarks.h"
#include "bench/log/log_load.h"
#include "bench/vision/vision_report.h"

namespace taclink::command {
namespace {

struct BenchLogOptions {
  bool quick = false;
  double megabytes = 1000;
  double max_gb = 10;
  double seconds = 30;
  std::string folder, taclinkd, markdown;
};

const char* Word(mcap::Compression compression) {
  return compression == mcap::Compression::kNone ? "none" : mcap::NameOf(compression).data();
}

Result<ReportTable> Writing(const std::vector<LogContent>& contents, const std::string& folder,
                            const BenchLogOptions& options) {
  ReportTable table{
      "Writing, until it is on the disk",
      {"messages", "compression", "MB/s", "plain write, MB/s", "of plain", "size", "CPU, us/message"},
      {}};
  for (const LogContent& content : contents) {
    for (const auto compression :
         {mcap::Compression::kNone, mcap::Compression::kLz4, mcap::Compression::kZstd}) {
      const auto r = MeasureWriting(content, compression, folder, options.megabytes, options.quick ? 1 : 5);
      if (!r) return r.error();
      table.rows.push_back({r->content, Word(r->compression), fmt::format("{:.0f}", r->log_mb_s),
                            fmt::format("{:.0f}", r->plain_mb_s), fmt::format("{:.2f}", r->ratio),
                            fmt::format("{:.2f}", r->size), fmt::format("{:.1f}", r->cpu_us)});
    }
  }
  return table;
}

Result<ReportTable> Reading(const std::vector<LogContent>& contents, const std::string& folder,
                            const BenchLogOptions& options) {
  ReportTable table{"Reading, uncompressed, from the page cache as far as it reaches",
                    {"GB", "hours", "messages", "open, ms", "seek p50, ms", "p99, ms", "MB/s"},
                    {}};
  for (const double gigabytes : {0.1, 1.0, 3.0, 10.0}) {
    if (gigabytes > options.max_gb) break;
    const auto r = MeasureReading(contents, folder, gigabytes);
    if (!r) return r.error();
    table.rows.push_back({fmt::format("{:.1f}", r->gigabytes), fmt::format("{:.3f}", r->hours),
                          std::to_string(r->messages), fmt::format("{:.1f}", r->open_ms),
                          fmt::format("{:.2f}", r->seek_p50_ms), fmt::format("{:.2f}", r->seek_p99_ms),
                          fmt::format("{:.0f}", r->read_mb_s)});
  }
  return table;
}

Result<ReportTable> Recording(const LoadPictures& pictures, const std::string& folder,
                              const BenchLogOptions& options) {
  ReportTable table{"A server of 6 links at 30 frames a second, 640x480",
                    {"recorded", "s", "frames", "lost", "skipped by the links", "MB/s", "server, cores",
                     "without recording, cores"},
                    {}};
  const auto results = MeasureRecording(pictures, options.taclinkd, folder, options.seconds);
  if (!results) return results.error();
  for (const RecordResult& r : *results) {
    table.rows.push_back({r.what, fmt::format("{:.0f}", r.seconds), std::to_string(r.frames),
                          std::to_string(r.lost), std::to_string(r.skipped), fmt::format("{:.1f}", r.mb_s),
                          fmt::format("{:.2f}", r.server_cores), fmt::format("{:.2f}", r.without_cores)});
  }
  return table;
}

Result<void> RunBenchLog(const BenchLogOptions& options) {
  if (auto good = CheckWritable({options.markdown}); !good) return good;
  const auto scratch = Scratch::Make(options.folder);
  if (!scratch) return scratch.error();
  const std::string folder = scratch->path.string();
  const auto pictures = RenderLoadPictures(folder);
  if (!pictures) return pictures.error();
  auto images = MakePictureContent(*pictures);
  if (!images) return images.error();
  std::vector<LogContent> contents;
  contents.push_back(MakeFrameContent());
  contents.push_back(std::move(*images));
  std::string markdown;
  const auto show = [&markdown](const Result<ReportTable>& table) -> Result<void> {
    if (!table) return table.error();
    std::printf("%s\n", AlignedText(*table).c_str());
    markdown += Markdown(*table) + "\n";
    return {};
  };
  if (const auto shown = show(Writing(contents, folder, options)); !shown) return shown;
  if (const auto shown = show(Reading(contents, folder, options)); !shown) return shown;
  contents.clear();
  if (const auto shown = show(Recording(*pictures, folder, options)); !shown) return shown;
  return WriteBetweenMarks(options.markdown, "taclink-bench log", markdown);
}

}  // namespace

void AddBenchLog(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchLogOptions>();
  const Arguments log = bench.AddCommand("log", "Writing, reading and recording of logs");
  log.AddFlag("--quick", options->quick, "One round of each");
  log.AddOption("--megabytes", options->megabytes, "Of messages, for each way of writing")
      .Must(Within(1, 1e5))
      .ShowDefault();
  log.AddOption("--max-gb", options->max_gb, "Size of the largest log that is read")
      .Must(Within(0, 1000))
      .ShowDefault();
  log.AddOption("--seconds", options->seconds, "Length of each recording")
      .Must(Within(0.5, 3600))
      .ShowDefault();
  log.AddOption("--folder", options->folder, "On the disk to measure (default: that of temporary files)");
  log.AddOption("--taclinkd", options->taclinkd, "The server's program (default: beside this one)");
  log.AddOption("--markdown", options->markdown,
                "File for the tables, or a page with marks to put them between");
  log.OnChosen([options, &selected] { selected = [options] { return RunBenchLog(*options); }; });
}

}  // namespace taclink::command
