#include <fmt/format.h>
#include <openssl/rand.h>
#include <openssl/sha.h>

#include <array>
#include <charconv>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/command/cli/commands.h"
#include "sensing/core/clock.h"
#include "sensing/core/name.h"
#include "sensing/core/utc_time.h"

namespace taclink::command {
namespace {

struct TokenOptions {
  std::vector<std::string> words;  // the name, and "new" before it or not
  std::string role = "viewer";
  std::string expires;
};

constexpr int64_t kSecondsPerDay = 86'400;
constexpr int kMostDays = 36'500;

std::string Hex(std::span<const uint8_t> bytes) {
  std::string out;
  for (const uint8_t byte : bytes) out += fmt::format("{:02x}", byte);
  return out;
}

int64_t NowUtcS() {
  return SystemClock().UtcNs() / 1'000'000'000;
}

// Of "90d", or of a time that ParseUtc reads. None: neither.
std::optional<int64_t> ExpiryOf(std::string_view text) {
  if (!text.ends_with('d')) return ParseUtc(text);
  int days = 0;
  const char* const end = text.data() + text.size() - 1;
  const auto [stop, error] = std::from_chars(text.data(), end, days);
  if (error != std::errc() || stop != end || days < 1 || days > kMostDays) return std::nullopt;
  return NowUtcS() + days * kSecondsPerDay;
}

std::string ExpiryProblem(const std::string& text) {
  const auto expiry = ExpiryOf(text);
  if (!expiry) return "must be days (90d) or a time of UTC (2027-01-31, 2027-01-31T12:00:00Z)";
  return *expiry > NowUtcS() ? "" : "is in the past";
}

std::string NameProblem(const std::string& name) {
  const auto good = CheckName(name);  // as the server reads it
  return good ? std::string() : good.error().message;
}

Result<void> RunToken(const TokenOptions& options) {
  std::array<uint8_t, 32> secret{};
  if (RAND_bytes(secret.data(), static_cast<int>(secret.size())) != 1)
    return Error{ErrorCode::kUnavailable, "this machine gives no random numbers"};
  const std::string token = Hex(secret);
  std::array<uint8_t, SHA256_DIGEST_LENGTH> hash{};
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  // The line may be redirected to the server's file; the token goes to a person.
  const std::string& name = options.words.back();
  const std::string expiry =
      options.expires.empty() ? "" : " expires=" + UtcText(ExpiryOf(options.expires).value());
  fmt::print(stderr, "token of {}, shown only now: {}\n", name, token);
  fmt::print("{} {} {}{}\n", name, options.role, Hex(hash), expiry);
  return {};
}

}  // namespace

void AddToken(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<TokenOptions>();
  const Arguments command = app.AddCommand(
      "token",
      "Make a token: itself to standard error, the line for the server's security.tokens to standard output");
  command.AddOption("name", options->words, "new NAME: whose it is; 'new' may be left out")
      .Required()
      .Expected(1, 2)
      .Must(Check(NameProblem));
  command.AddOption("--role", options->role, "viewer: sees everything; operator: also changes things")
      .Must(OneOf({"viewer", "operator"}))
      .ShowDefault();
  command
      .AddOption("--expires", options->expires,
                 "Refused from then on: in days (90d), or a time of UTC (2027-01-31, 2027-01-31T12:00:00Z)")
      .Must(Check(ExpiryProblem));
  command.OnChosen([options, &selected] {
    if (options->words.size() == 2 && options->words.front() != "new")
      RefuseOption("name", "what can be done with tokens is 'new NAME'");
    if (options->words == std::vector<std::string>{"new"})
      RefuseMissing("the name that the new token is for");
    selected = [options] { return RunToken(*options); };
  });
}

}  // namespace taclink::command
