#include "client/command/connect.h"

#include "client/command/commands.h"

namespace taclink::command {
namespace {

// One command runs in a process, and all that talk to a server do it with the same credentials.
client::Credentials& ChosenCredentials() {
  static client::Credentials credentials;
  return credentials;
}

}  // namespace

void AddServerOption(CLI::App& command, std::string& address) {
  command.add_option("--server", address, "Address of the server, host:port")
      ->envname("TACLINK_SERVER")
      ->check([](const std::string& text) {
        return text.empty() ? std::string("must be host:port") : std::string();
      })
      ->capture_default_str();
  client::Credentials& credentials = ChosenCredentials();
  command.add_option("--token", credentials.token, "Token that the server knows (better in TACLINK_TOKEN)")
      ->envname("TACLINK_TOKEN");
  command
      .add_option("--tls-ca", credentials.ca_file, "Certificates that the server's must be signed by: TLS")
      ->envname("TACLINK_TLS_CA");
  command.add_option("--tls-certificate", credentials.certificate_file, "This client's own certificate")
      ->envname("TACLINK_TLS_CERTIFICATE");
  command.add_option("--tls-key", credentials.key_file, "The key of this client's certificate")
      ->envname("TACLINK_TLS_KEY");
}

Result<client::Client> ConnectTo(const std::string& server) {
  return client::Client::Connect(server, std::chrono::seconds(3), ChosenCredentials());
}

}  // namespace taclink::command
