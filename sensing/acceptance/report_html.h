#pragma once

#include <string>

#include "sensing/acceptance/acceptance.h"
#include "sensing/acceptance/acceptance_report.h"

namespace taclink {

/// The report as one HTML page that needs no other file and no network: verdict, findings, quantities with
/// their intervals and limits, plots, and all trials.
std::string AcceptanceHtml(const AcceptanceRecord& record, const AcceptanceReport& report);

/// A line for each trial: what was done, the reference, what was measured, and the errors. SI-near units in
/// the column names (N, mm, kPa).
std::string AcceptanceCsv(const AcceptanceRecord& record, const AcceptanceReport& report);

}  // namespace taclink
