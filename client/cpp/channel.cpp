#include "client/cpp/channel.h"

#include <arpa/inet.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/client_interceptor.h>

#include <chrono>
#include <utility>
#include <vector>

#include "client/cpp/patience.h"
#include "sensing/core/read_file.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;

constexpr int kKeepaliveMs = 10'000;
constexpr milliseconds kKeepalivePatience{5'000};
constexpr milliseconds kAttemptPatience{20'000};  // gRPC's own

// gRPC's own call credentials refuse to go without TLS, also to this machine itself.
class TokenInterceptor final : public grpc::experimental::Interceptor {
 public:
  explicit TokenInterceptor(std::string authorization) : authorization_(std::move(authorization)) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using grpc::experimental::InterceptionHookPoints;
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA))
      methods->GetSendInitialMetadata()->emplace("authorization", authorization_);
    methods->Proceed();
  }

 private:
  const std::string authorization_;
};

class TokenInterceptorFactory final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenInterceptorFactory(const std::string& token) : authorization_("Bearer " + token) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(grpc::experimental::ClientRpcInfo*) override {
    return new TokenInterceptor(authorization_);  // gRPC deletes it
  }

 private:
  const std::string authorization_;
};

// Not by its beginning: 127.0.0.1.example.com is a name like any other.
bool StaysHere(const std::string& address) {
  if (address.starts_with("unix:")) return true;
  const std::string host = address.substr(0, address.rfind(':'));
  if (host == "localhost" || host == "[::1]") return true;
  in_addr ip{};
  return inet_pton(AF_INET, host.c_str(), &ip) == 1 && ntohl(ip.s_addr) >> 24 == 127;
}

Result<std::string> ReadFileIfAny(const std::string& path) {
  return path.empty() ? Result<std::string>(std::string()) : ReadText(path);
}

Result<std::shared_ptr<grpc::ChannelCredentials>> MakeCredentials(const Credentials& credentials) {
  if (credentials.certificate_file.empty() != credentials.key_file.empty())
    return Error{ErrorCode::kInvalidArgument, "a client's certificate and its key need each other"};
  if (credentials.ca_file.empty()) {
    if (credentials.key_file.empty()) return grpc::InsecureChannelCredentials();
    return Error{ErrorCode::kInvalidArgument,
                 "a client's certificate needs TLS: say with --tls-ca whom to trust as the server"};
  }
  grpc::SslCredentialsOptions options;
  for (const auto& [file, text] : {std::pair(&credentials.ca_file, &options.pem_root_certs),
                                   std::pair(&credentials.certificate_file, &options.pem_cert_chain),
                                   std::pair(&credentials.key_file, &options.pem_private_key)}) {
    auto read = ReadFileIfAny(*file);
    if (!read) return read.error();
    *text = std::move(*read);
  }
  return grpc::SslCredentials(options);
}

}  // namespace

Result<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& address,
                                                   const Credentials& credentials) {
  const auto attempt = PatienceFromEnvironment(kAttemptPatience);
  if (!attempt) return attempt.error();
  auto secrets = MakeCredentials(credentials);
  if (!secrets) return secrets.error();
  if (!credentials.token.empty() && credentials.ca_file.empty() && !StaysHere(address))
    return Error{ErrorCode::kInvalidArgument,
                 "the token would go to " + address + " in the clear; use TLS (--tls-ca)"};
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);  // robots are on the local network
  // A connection of its own: on a shared one, a stream that is not read would hold up the others.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  // A server that is cut off says nothing: it is asked while calls are open, also when none of them sends.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, static_cast<int>(Patience(kKeepalivePatience).count()));
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Despite its name: how long one attempt to connect may take.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, static_cast<int>(attempt->count()));
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> interceptors;
  if (!credentials.token.empty())
    interceptors.push_back(std::make_unique<TokenInterceptorFactory>(credentials.token));
  return grpc::experimental::CreateCustomChannelWithInterceptors(address, *secrets, arguments,
                                                                 std::move(interceptors));
}

}  // namespace taclink::client
