#include <fmt/format.h>
#include <openssl/rand.h>
#include <openssl/sha.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "client/command/commands.h"

namespace taclink::command {
namespace {

struct Options {
  std::string name;
  std::string role = "viewer";
};

std::string Hex(std::span<const uint8_t> bytes) {
  std::string out;
  for (const uint8_t byte : bytes) out += fmt::format("{:02x}", byte);
  return out;
}

Result<void> Run(const Options& options) {
  std::array<uint8_t, 32> secret{};
  if (RAND_bytes(secret.data(), static_cast<int>(secret.size())) != 1)
    return Error{ErrorCode::kUnavailable, "this machine gives no random numbers"};
  const std::string token = Hex(secret);
  std::array<uint8_t, SHA256_DIGEST_LENGTH> hash{};
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  // The line may be redirected to the server's file; the token goes to a person.
  fmt::print(stderr, "token of {}, shown only now: {}\n", options.name, token);
  fmt::print("{} {} {}\n", options.name, options.role, Hex(hash));
  return {};
}

}  // namespace

void AddToken(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<Options>();
  const Arguments command = app.AddCommand(
      "token",
      "Make a token: itself to standard error, the line for the server's security.tokens to standard output");
  command.AddOption("name", options->name, "Whose it is").Required().Must(Check([](const std::string& name) {
    const bool good = !name.empty() && name.find_first_of(" \t\r\n#") == std::string::npos;
    return good ? std::string() : std::string("a name without spaces and '#'");
  }));
  command.AddOption("--role", options->role, "viewer: sees everything; operator: also changes things")
      .Must(OneOf({"viewer", "operator"}))
      .ShowDefault();
  command.OnChosen([options, &selected] { selected = [options] { return Run(*options); }; });
}

}  // namespace taclink::command
