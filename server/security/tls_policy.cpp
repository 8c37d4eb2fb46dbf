#include "server/security/tls_policy.h"

#include <cstdlib>

namespace taclink::server {

void LimitGrpcCiphers() {
  ::setenv("GRPC_SSL_CIPHER_SUITES", kTlsCiphers, 0);
}

}  // namespace taclink::server
