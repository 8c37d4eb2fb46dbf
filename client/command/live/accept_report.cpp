#include "client/command/live/accept_report.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "client/command/cli/terminal_style.h"
#include "client/command/cli/units.h"
#include "sensing/core/printable.h"
#include "sensing/core/utc_time.h"

namespace taclink::command {
namespace {

constexpr int64_t kNsPerSecond = 1'000'000'000;

std::string NumberText(const v1::AcceptanceQuantity& quantity) {
  if (quantity.verdict() == v1::QUANTITY_VERDICT_NOT_MEASURED) return "-";
  return fmt::format("{:.3g} {}", quantity.value(), quantity.unit());
}

std::string IntervalText(const v1::AcceptanceQuantity& quantity) {
  if (!quantity.has_low() || !quantity.has_high()) return "-";
  return fmt::format("{:.3g} to {:.3g}", quantity.low(), quantity.high());
}

std::string VerdictWord(const std::string& word, bool is_good, bool is_bad) {
  if (!WantsColor()) return word;
  return Colored(word, is_bad ? Color::kRed : is_good ? Color::kGreen : Color::kYellow);
}

void PrintQuantities(const v1::AcceptanceReport& report) {
  size_t width = 8;
  for (const auto& quantity : report.quantities()) width = std::max(width, quantity.label().size());
  fmt::print("{:<{}}  {:>14}  {:>18}  {:>10}  {:>5}  {}\n", "QUANTITY", width, "VALUE", "95 % INTERVAL",
             "LIMIT", "LOADS", "VERDICT");
  for (const auto& quantity : report.quantities()) {
    if (quantity.verdict() == v1::QUANTITY_VERDICT_NOT_MEASURED) continue;
    const std::string verdict(client::Name(quantity.verdict()));
    fmt::print("{:<{}}  {:>14}  {:>18}  {:>10}  {:>5}  {}\n", Printable(quantity.label()), width,
               NumberText(quantity), IntervalText(quantity),
               quantity.has_limit() ? fmt::format("{:.3g}", quantity.limit()) : "-", quantity.loads(),
               VerdictWord(verdict, quantity.verdict() == v1::QUANTITY_VERDICT_PASSED,
                           quantity.verdict() == v1::QUANTITY_VERDICT_FAILED));
  }
}

Result<void> WriteText(const std::string& path, const std::string& text) {
  if (path.empty()) return {};
  std::ofstream file(path, std::ios::trunc | std::ios::binary);
  file << text;
  file.close();
  if (!file) return Error{ErrorCode::kUnavailable, "cannot write '" + path + "'"};
  return {};
}

}  // namespace

void PrintAcceptance(const v1::Acceptance& acceptance, bool json) {
  if (json) {
    std::string text;
    google::protobuf::util::JsonPrintOptions options;
    options.preserve_proto_field_names = true;
    options.always_print_primitive_fields = true;
    static_cast<void>(google::protobuf::util::MessageToJsonString(acceptance, &text, options));
    fmt::print("{}\n", text);
    return;
  }
  const v1::AcceptanceReport& report = acceptance.report();
  const std::string verdict(client::Name(report.verdict()));
  fmt::print("Acceptance of link {} by plan {}: {}\n", Printable(acceptance.link()),
             Printable(acceptance.plan()),
             VerdictWord(verdict, report.verdict() == v1::ACCEPTANCE_VERDICT_PASSED,
                         report.verdict() == v1::ACCEPTANCE_VERDICT_FAILED));
  fmt::print("{} trials measured, {} skipped, {} open\n", report.measured(), report.skipped(), report.open());
  for (const auto& finding : report.findings())
    fmt::print("{}: {}\n", Printable(finding.id()), Printable(finding.text()));
  PrintQuantities(report);
}

Result<void> SaveReport(client::Acceptances& calls, const std::string& link, const std::string& html,
                        const std::string& csv) {
  if (html.empty() && csv.empty()) return {};
  v1::GetAcceptanceRequest request;
  request.set_link(link);
  request.set_with_files(true);
  const auto acceptance = calls.Get(request);
  if (!acceptance) return acceptance.error();
  if (auto written = WriteText(html, acceptance->report_html()); !written) return written;
  return WriteText(csv, acceptance->report_csv());
}

std::string AcceptanceText(const v1::Link& link) {
  if (!link.has_acceptance()) return "";
  const v1::AcceptanceSummary& summary = link.acceptance();
  std::string text = fmt::format("{} on {}", client::Name(summary.verdict()),
                                 UtcText(summary.finished_utc_ns() / kNsPerSecond));
  if (summary.has_force_bias()) {
    text += fmt::format(": force {:+.1f}", 100 * summary.force_bias());
    if (summary.has_force_bias_half_width())
      text += fmt::format(" ± {:.1f}", 100 * summary.force_bias_half_width());
    text += " %";
  }
  if (summary.has_force_error_95())
    text += fmt::format(", single loads {:.0f} %", 100 * summary.force_error_95());
  if (summary.has_place_error_95_m())
    text += fmt::format(", place {:.1f} mm", kMmPerMetre * summary.place_error_95_m());
  for (const std::string& finding : summary.findings()) text += "; " + Printable(finding);
  if (!summary.outdated().empty()) text += "; OUTDATED: " + Printable(summary.outdated());
  return text;
}

}  // namespace taclink::command
