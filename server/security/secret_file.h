#pragma once

#include <string>

#include "sensing/core/result.h"

namespace taclink::server {

/// A file that only the server, and who is in its group, may read or write: a private key, a password, the
/// hashes of tokens. A group that may read it must be root's or one of the server's. `what` names its use in
/// messages. Errors: kPermissionDenied (open to others) with what to do, those of FileError.
Result<void> CheckSecretFile(const std::string& what, const std::string& path);

/// Its content, as ReadText gives it. Errors: likewise, and those of ReadText.
Result<std::string> ReadSecretFile(const std::string& what, const std::string& path);

/// The same where anybody may read it. Errors: those of ReadText, with `what` before.
Result<std::string> ReadSecurityFile(const std::string& what, const std::string& path);

}  // namespace taclink::server
