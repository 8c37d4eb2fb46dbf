#pragma once

namespace taclink::server {

/// Of TLS 1.2, in OpenSSL's words: authenticated encryption with ephemeral keys, nothing else. TLS 1.3 has no
/// other suites. Of gRPC and of the HTTP gateway alike.
inline constexpr const char* kTlsCiphers = "ECDHE+AESGCM:ECDHE+CHACHA20";

/// Has gRPC take these, unless the environment (GRPC_SSL_CIPHER_SUITES) names others already. gRPC reads it
/// once: for the first lines of main, before gRPC is used and other threads run.
void LimitGrpcCiphers();

/// Least sizes of keys, of the security that 112 bits give [NIST SP 800-57 part 1].
inline constexpr int kLeastRsaBits = 2048, kLeastEcBits = 256;

}  // namespace taclink::server
