#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include "client/command/cli/log_text.h"
#include "client/command/logs/force_plot.h"
#include "client/command/logs/log_output.h"
#include "client/command/logs/log_tools.h"
#include "client/command/logs/log_visitor.h"
#include "wire/magnitude.h"

namespace taclink::command {
namespace {

struct LogPlotOptions {
  std::string input, output;
  PartOptions part;
};

double Seconds(uint64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}

/// Of the part, as far as the log goes; times since the log's start.
ForcePlot EmptyPlot(const LogSource& source, const LogPart& part) {
  const mcap::Statistics& log = source.reader().statistics();
  const uint64_t start_ns = std::max(part.start_ns, log.message_start_ns) - log.message_start_ns;
  const uint64_t end_ns = std::min(part.end_ns, log.message_end_ns) - log.message_start_ns;
  constexpr double kShortest = 1e-3;
  return {fmt::format("{}: from {}, {:.3f} s", std::filesystem::path(source.file()).filename().string(),
                      UtcText(log.message_start_ns), Seconds(log.message_end_ns - log.message_start_ns)),
          Seconds(start_ns), std::max(Seconds(end_ns), Seconds(start_ns) + kShortest)};
}

Result<void> Fill(LogSource& source, const LogPart& part, ForcePlot& plot) {
  const auto log_start_ns = static_cast<int64_t>(source.reader().statistics().message_start_ns);
  const auto at = [&](int64_t log_utc_ns) { return static_cast<double>(log_utc_ns - log_start_ns) * 1e-9; };
  LogVisitor visitor;
  visitor.frame = [&](const v1::LinkFrame& frame, int64_t utc_ns) {
    std::vector<ForcePlot::ContactForce> contacts;
    for (const v1::Contact& contact : frame.contacts())
      contacts.push_back({contact.id(), wire::MagnitudeN(contact)});
    std::optional<double> total_n;
    if (IsMeasured(frame)) total_n = wire::TotalMagnitudeN(frame);
    plot.AddFrame(frame.link(), at(utc_ns), total_n, contacts);
    return Result<void>();
  };
  visitor.event = [&](const v1::Event& event, int64_t utc_ns) {
    if (event.kind() == v1::EVENT_KIND_CONTACT_BEGIN) plot.AddContactBegin(event.link(), at(utc_ns));
    if (event.kind() == v1::EVENT_KIND_CONTACT_END) plot.AddContactEnd(event.link(), at(utc_ns));
    return Result<void>();
  };
  return Visit(source, part, visitor);
}

Result<void> Plot(const LogPlotOptions& options) {
  auto source = LogSource::Open(options.input);
  if (!source) return source.error();
  const auto part = ChoosePart(**source, options.part);
  if (!part) return part.error();
  auto output = OutputText::Create(options.output);
  if (!output) return output.error();
  ForcePlot plot = EmptyPlot(**source, *part);
  if (const auto filled = Fill(**source, *part, plot); !filled) return filled;
  if (const auto reported = (*source)->Report(); !reported) return reported;
  if (plot.empty()) {
    return Error{ErrorCode::kNotFound,
                 options.input + ": holds no frames of links in this part; see 'taclink log info'"};
  }
  if (const auto written = (*output)->Write(plot.Svg()); !written) return written;
  if (const auto finished = (*output)->Finish(); !finished) return finished;
  fmt::print("{}\n", options.output);
  return {};
}

}  // namespace

void AddLogPlot(const Arguments& log, Selected& selected) {
  auto options = std::make_shared<LogPlotOptions>();
  const Arguments plot = log.AddCommand("plot", "Draw the forces of a log over time, a panel for each link");
  plot.AddOption("file", options->input, "The log, MCAP").Required();
  plot.AddOption("-o,--output", options->output, "The new SVG file").Required();
  AddPartOptions(plot, options->part);
  plot.OnChosen([options, &selected] { selected = [options] { return Plot(*options); }; });
}

}  // namespace taclink::command
