#include "client/command/live/connect.h"

#include "client/command/cli/commands.h"

namespace taclink::command {
namespace {

// One command runs in a process, and all that talk to a server do it with the same credentials.
client::Credentials& ChosenCredentials() {
  static client::Credentials credentials;
  return credentials;
}

}  // namespace

void AddServerOption(const Arguments& command, std::string& address) {
  command.AddOption("--server", address, "Address of the server, host:port")
      .FromEnvironment("TACLINK_SERVER")
      .Must(Check([](const std::string& text) {
        return text.empty() ? std::string("must be host:port") : std::string();
      }))
      .ShowDefault();
  client::Credentials& credentials = ChosenCredentials();
  command.AddOption("--token", credentials.token, "Token that the server knows (better in TACLINK_TOKEN)")
      .FromEnvironment("TACLINK_TOKEN");
  command.AddOption("--tls-ca", credentials.ca_file, "Certificates that the server's must be signed by: TLS")
      .FromEnvironment("TACLINK_TLS_CA");
  command.AddOption("--tls-certificate", credentials.certificate_file, "This client's own certificate")
      .FromEnvironment("TACLINK_TLS_CERTIFICATE");
  command.AddOption("--tls-key", credentials.key_file, "The key of this client's certificate")
      .FromEnvironment("TACLINK_TLS_KEY");
}

Result<client::Client> ConnectTo(const std::string& server) {
  return client::Client::Connect(server, ChosenCredentials());
}

std::chrono::milliseconds SilencePatience() {
  return client::Patience(std::chrono::seconds(5));
}

}  // namespace taclink::command
