#pragma once

#include <string>

#include "client/cpp/taclink/acceptance.h"

namespace taclink::command {

/// Verdict, findings and quantities of an acceptance for people, or all of it as one JSON object.
void PrintAcceptance(const v1::Acceptance& acceptance, bool json);

/// Writes the report's page and table where they are wanted; empty: not. Errors: kUnavailable.
Result<void> SaveReport(client::Acceptances& calls, const std::string& link, const std::string& html,
                        const std::string& csv);

/// "passed on 2026-11-30: force +1.2 ± 2.0 %, place 2.1 mm", in a line; empty: the link has none.
std::string AcceptanceText(const v1::Link& link);

}  // namespace taclink::command
