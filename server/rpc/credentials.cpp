#include "server/rpc/credentials.h"

#include <fmt/format.h>
#include <grpc/grpc.h>
#include <grpc/grpc_security.h>

#include <cstdint>
#include <mutex>
#include <span>
#include <string_view>
#include <utility>

#include "server/rpc/requests/status.h"
#include "server/security/single_header.h"

namespace taclink::server {
namespace {

// gRPC's C++ interface has no certificates that change by a decision of ours (its file watcher also takes a
// key that is not the certificate's, and then refuses everyone), hence its C interface.

/// What gRPC's callbacks work on; lives as long as gRPC's credentials.
struct Guard {
  std::shared_ptr<const Security> security;
  std::mutex mutex;
  std::shared_ptr<const TlsMaterial> given;  // guarded by mutex: what gRPC has
};

// Called before each handshake.
grpc_ssl_certificate_config_reload_status FetchCertificates(void* state,
                                                            grpc_ssl_server_certificate_config** config) {
  auto& guard = *static_cast<Guard*>(state);
  const auto material = guard.security->tls();
  const std::lock_guard lock(guard.mutex);
  if (!material) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_FAIL;
  if (material == guard.given) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
  const grpc_ssl_pem_key_cert_pair pair{material->key.c_str(), material->certificate.c_str()};
  // gRPC demands roots even where it asks clients for nothing and so never uses them.
  const std::string& client_ca = material->client_ca.empty() ? material->certificate : material->client_ca;
  *config = grpc_ssl_server_certificate_config_create(client_ca.c_str(), &pair, 1);
  guard.given = material;
  return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
}

std::string_view View(const grpc_slice& slice) {
  return {reinterpret_cast<const char*>(GRPC_SLICE_START_PTR(slice)), GRPC_SLICE_LENGTH(slice)};
}

// gRPC does not tell an address here, so that each connection counts for itself, by a number that does not
// tell where in memory it is.
std::string ConnectionPlace(const grpc_auth_context* connection) {
  constexpr uint64_t kMixer = 0x9E3779B97F4A7C15;
  return fmt::format("gRPC connection {:04x}", reinterpret_cast<uintptr_t>(connection) * kMixer >> 48);
}

Result<Caller> CheckMetadata(const Security& security, std::span<const grpc_metadata> metadata,
                             const std::string& place) {
  SingleHeader path(":path"), authorization("authorization");
  for (const grpc_metadata& entry : metadata) {
    path.Read(View(entry.key), View(entry.value));
    authorization.Read(View(entry.key), View(entry.value));
  }
  for (const SingleHeader* header : {&path, &authorization})
    if (const auto value = header->Value(); !value) return value.error();
  return security.Check(*path.Value(), *authorization.Value(), place);
}

// Called before each call.
void CheckCall(void* state, grpc_auth_context* connection, const grpc_metadata* metadata, size_t count,
               grpc_process_auth_metadata_done_cb done, void* user_data) {
  const auto caller =
      CheckMetadata(*static_cast<Guard*>(state)->security, {metadata, count}, ConnectionPlace(connection));
  const grpc::Status status = caller ? grpc::Status::OK : ToGrpc(caller.error());
  done(user_data, nullptr, 0, nullptr, 0, static_cast<grpc_status_code>(status.error_code()),
       status.error_message().c_str());
}

class GuardedCredentials final : public grpc::ServerCredentials {
 public:
  GuardedCredentials(grpc_server_credentials* credentials, Guard* guard) : credentials_(credentials) {
    grpc_server_credentials_set_auth_metadata_processor(
        credentials_, {.process = CheckCall,
                       .destroy = [](void* state) { delete static_cast<Guard*>(state); },
                       .state = guard});
  }
  ~GuardedCredentials() override { grpc_server_credentials_release(credentials_); }

  // The check is built in.
  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {}

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    return grpc_server_add_http2_port(server, address.c_str(), credentials_);
  }

  grpc_server_credentials* const credentials_;
};

}  // namespace

bool HasTls(const std::string& listen, const Security& security) {
  return security.tls() != nullptr && !listen.starts_with("unix:");
}

std::shared_ptr<grpc::ServerCredentials> MakeCredentials(const std::string& listen,
                                                         const std::shared_ptr<const Security>& security) {
  const bool unix_socket = listen.starts_with("unix:");
  const auto tls = security->tls();
  const bool encrypt = HasTls(listen, *security);
  if (!encrypt && !security->needs_token()) return grpc::InsecureServerCredentials();
  auto* const guard =
      new Guard{.security = security, .mutex = {}, .given = {}};  // GuardedCredentials deletes it
  if (!encrypt)
    return std::make_shared<GuardedCredentials>(
        grpc_local_server_credentials_create(unix_socket ? UDS : LOCAL_TCP), guard);
  const auto clients = tls->client_ca.empty() ? GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE
                                              : GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY;
  return std::make_shared<GuardedCredentials>(
      grpc_ssl_server_credentials_create_with_options(
          grpc_ssl_server_credentials_create_options_using_config_fetcher(clients, FetchCertificates, guard)),
      guard);
}

}  // namespace taclink::server
