#pragma once

#include "server/assembly/config_check.h"

namespace taclink::server {

/// Listens for a moment where the server would, on both addresses at once. Errors: an address that is not
/// this machine's, not permitted, or in use, with the program that uses it where that can be seen; of another
/// taclinkd it is a note, since that may be the one whose configuration is being changed.
void CheckListening(const Config& config, ConfigFindings& out);

}  // namespace taclink::server
