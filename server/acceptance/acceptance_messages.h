#pragma once

#include "sensing/acceptance/acceptance.h"
#include "sensing/acceptance/acceptance_report.h"
#include "taclink/v1/acceptance.pb.h"

namespace taclink::server {

/// Converts a record, without its report, to the message of the API and of the server's files (SI units).
void Fill(const AcceptanceRecord& record, v1::Acceptance& out);
void Fill(const AcceptanceReport& report, v1::AcceptanceReport& out);
/// Summary of a finished acceptance, for Link.acceptance.
v1::AcceptanceSummary SummaryOf(const AcceptanceRecord& record, const AcceptanceReport& report);

/// Without the limits, which are part of the plan. Values that this build does not know become the weakest
/// ones.
AcceptanceRecord FromWire(const v1::Acceptance& message);
/// In the link frame; with in_base_frame converted by `base_from_link`.
TrialReference FromWire(const v1::TrialReference& message, const Rigid3& base_from_link = {});

}  // namespace taclink::server
