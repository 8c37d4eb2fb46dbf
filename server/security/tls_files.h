#pragma once

#include <string>

#include "sensing/core/result.h"
#include "server/config/options.h"

namespace taclink::server {

/// What TLS needs, as PEM texts that were checked: they parse, the key is the certificate's, and keys and
/// signatures are as strong as server/security/tls_policy.h wants them, so that no client refuses them for
/// it.
struct TlsMaterial {
  std::string certificate;  ///< chain, the server's own first
  std::string key;
  std::string client_ca;  ///< empty: clients need no certificate

  bool operator==(const TlsMaterial&) const = default;
};

/// Reads and checks the configured files. Errors: kNotFound, kInvalidArgument,
/// kPermissionDenied (see CheckSecretFile); they name the file.
Result<TlsMaterial> ReadTlsFiles(const SecurityConfig& config);

/// What is worth a warning but works: a certificate out of its time. Empty: none.
std::string TlsWarnings(const SecurityConfig& config, const TlsMaterial& material);

}  // namespace taclink::server
