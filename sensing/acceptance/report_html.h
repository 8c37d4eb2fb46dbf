#pragma once

#include <string>

#include "sensing/acceptance/acceptance.h"
#include "sensing/acceptance/acceptance_report.h"

namespace taclink {

/// The report as one self-contained HTML page: verdict, findings, quantities with intervals and limits,
/// plots, and all trials.
std::string AcceptanceHtml(const AcceptanceRecord& record, const AcceptanceReport& report);

/// One line per trial: plan, reference, measurement and errors. The column names give the units (N, mm, kPa).
std::string AcceptanceCsv(const AcceptanceRecord& record, const AcceptanceReport& report);

}  // namespace taclink
