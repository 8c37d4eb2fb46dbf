#include <cstdio>
#include <memory>
#include <string>

#include "bench/acceptance/acceptance_bench.h"
#include "bench/command/bench_files.h"
#include "bench/command/benchmarks.h"
#include "sensing/acceptance/report_html.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

struct BenchAcceptanceOptions {
  std::string model = "cylinder", markdown, html;
  int links = 60, first = 0, jobs = 1;
};

void TellAccepted(const AcceptanceOutcome& outcome) {
  if (!outcome.failure.empty()) {
    std::fprintf(stderr, "%3llu: %s\n", static_cast<unsigned long long>(outcome.seed),
                 outcome.failure.c_str());
    return;
  }
  std::fprintf(stderr, "%3llu %c%-9s %s, %s, %.0f s of CPU\n", static_cast<unsigned long long>(outcome.seed),
               outcome.is_negative ? '-' : '+', kLinkFlawNames[static_cast<size_t>(outcome.flaw)],
               outcome.is_found ? "found" : "-", Name(outcome.report.verdict), outcome.cpu_s);
  for (const AcceptanceFinding& finding : outcome.report.findings)
    std::fprintf(stderr, "      %s: %s\n", Name(finding.id), finding.text.c_str());
  for (const AcceptanceClaim& claim : outcome.claims)
    std::fprintf(stderr, "      %s: %.2f in [%.2f, %.2f]%s\n", claim.quantity.c_str(), claim.truth, claim.low,
                 claim.high, claim.holds() ? "" : "  MISSED");
}

Result<void> BenchAcceptance(const BenchAcceptanceOptions& options) {
  if (auto good = CheckWritable({options.markdown, options.html}); !good) return good;
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  const auto outcomes = RunAcceptanceBench(
      *model, {.links = options.links, .first = options.first, .jobs = options.jobs, .done = TellAccepted});
  const ReportTable table = AcceptanceTable(outcomes);
  std::printf("%s\n", AlignedText(table).c_str());
  if (!options.html.empty() && !outcomes.empty()) {
    const std::string page = AcceptanceHtml(outcomes.front().record, outcomes.front().report);
    if (auto written = WriteText(options.html, page); !written) return written;
  }
  return WriteBetweenMarks(options.markdown, "taclink-bench acceptance", Markdown(table) + "\n");
}

}  // namespace

void AddBenchAcceptance(const Arguments& bench, Selected& selected) {
  auto options = std::make_shared<BenchAcceptanceOptions>();
  const Arguments command = bench.AddCommand(
      "acceptance", "Accept simulated links with known flaws: are the flaws found, do the intervals hold?");
  command.AddOption("--model", options->model, "Link model").ShowDefault();
  command.AddOption("--links", options->links, "Number of links").Must(Between(1, 10000)).ShowDefault();
  command.AddOption("--first", options->first, "Seed of the first one; the flaw follows from the seed")
      .Must(Between(0, 1000000))
      .ShowDefault();
  command.AddOption("--jobs", options->jobs, "Links at the same time").Must(Between(1, 256));
  command.AddOption("--markdown", options->markdown,
                    "File for the table, or a page with marks to put it between");
  command.AddOption("--html", options->html, "File for the first link's report");
  command.OnChosen([options, &selected] { selected = [options] { return BenchAcceptance(*options); }; });
}

}  // namespace taclink::command
