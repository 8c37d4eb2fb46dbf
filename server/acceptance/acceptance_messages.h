#pragma once

#include "sensing/acceptance/acceptance.h"
#include "sensing/acceptance/acceptance_report.h"
#include "taclink/v1/acceptance.pb.h"

namespace taclink::server {

/// A record as the API and the files of the server have it, without its report. SI units there.
void Fill(const AcceptanceRecord& record, v1::Acceptance& out);
void Fill(const AcceptanceReport& report, v1::AcceptanceReport& out);
/// What clients see of a finished acceptance with the link.
v1::AcceptanceSummary SummaryOf(const AcceptanceRecord& record, const AcceptanceReport& report);

/// Without the limits, which the plan has. Values that this build does not know become the weakest ones.
AcceptanceRecord FromWire(const v1::Acceptance& message);
/// Link frame, unless in_base_frame: then that of `base_from_link`.
TrialReference FromWire(const v1::TrialReference& message, const Rigid3& base_from_link = {});

}  // namespace taclink::server
