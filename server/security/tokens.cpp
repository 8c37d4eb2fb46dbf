#include "server/security/tokens.h"

#include <openssl/crypto.h>
#include <openssl/sha.h>

#include <algorithm>
#include <charconv>
#include <sstream>
#include <utility>

#include "sensing/core/utc_time.h"

namespace taclink::server {
namespace {

constexpr std::string_view kExpires = "expires=";
constexpr size_t kMostNamed = 8;  // changes

// "eve (viewer, until 2027-01-31T00:00:00Z)"
std::string Text(const Tokens::Entry& entry) {
  return entry.caller.name + (entry.caller.role == Role::kOperator ? " (operator" : " (viewer") +
         (entry.expires_utc_s ? ", until " + UtcText(*entry.expires_utc_s) : "") + ")";
}

const Tokens::Entry* SameToken(const Tokens& tokens, const Tokens::Entry& entry) {
  const auto at = std::find_if(tokens.entries().begin(), tokens.entries().end(),
                               [&](const auto& other) { return other.hash == entry.hash; });
  return at == tokens.entries().end() ? nullptr : &*at;
}

Result<std::optional<int64_t>> ParseExpiry(const std::string& word) {
  if (word.empty()) return std::optional<int64_t>();
  const auto time =
      word.starts_with(kExpires) ? ParseUtc(std::string_view(word).substr(kExpires.size())) : std::nullopt;
  if (!time)
    return Error{ErrorCode::kInvalidArgument,
                 "after the SHA-256 only 'expires=2027-01-31T00:00:00Z' may stand (UTC; or the date alone)"};
  return time;
}

}  // namespace

Result<Tokens::Entry> Tokens::ParseLine(std::string_view line) {
  std::istringstream words{std::string(line)};
  std::string role, hash, expiry, more;
  Entry entry;
  words >> entry.caller.name >> role >> hash >> expiry;
  if (hash.empty() || words >> more)
    return Error{ErrorCode::kInvalidArgument,
                 "must be 'NAME ROLE SHA256-OF-TOKEN [expires=TIME]'; 'taclink token new' makes such a line"};
  if (role != "viewer" && role != "operator")
    return Error{ErrorCode::kInvalidArgument, "the role must be viewer or operator, not '" + role + "'"};
  entry.caller.role = role == "operator" ? Role::kOperator : Role::kViewer;
  bool good = hash.size() == 2 * entry.hash.size();
  for (size_t i = 0; good && i < entry.hash.size(); ++i) {
    const char* const digits = hash.data() + 2 * i;
    const auto [end, error] = std::from_chars(digits, digits + 2, entry.hash[i], 16);
    good = error == std::errc() && end == digits + 2;
  }
  if (!good)
    return Error{ErrorCode::kInvalidArgument,
                 "the token's SHA-256 must be 64 hexadecimal digits; 'taclink token new' makes such a line"};
  const auto expires = ParseExpiry(expiry);
  if (!expires) return expires.error();
  entry.expires_utc_s = *expires;
  return entry;
}

Result<Tokens> Tokens::Parse(const std::string& name, std::string_view text) {
  Tokens tokens;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    line.erase(std::min(line.find('#'), line.size()));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    auto entry = ParseLine(line);
    if (!entry)
      return Error{entry.error().code, name + ":" + std::to_string(number) + ": " + entry.error().message};
    if (const Entry* const twin = SameToken(tokens, *entry))
      return Error{ErrorCode::kInvalidArgument, name + ":" + std::to_string(number) +
                                                    ": is the same token as '" + twin->caller.name +
                                                    "' has above; remove one of the lines"};
    tokens.entries_.push_back(std::move(*entry));
  }
  if (tokens.entries_.empty())
    return Error{ErrorCode::kInvalidArgument,
                 name + ": holds no token, so that nobody could call; 'taclink token new' makes its lines"};
  return tokens;
}

Tokens::Hash Tokens::HashOf(std::string_view token) {
  Hash hash;
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  return hash;
}

const Tokens::Entry* Tokens::Find(std::string_view token) const {
  const Hash hash = HashOf(token);
  const Entry* found = nullptr;
  for (const Entry& entry : entries_) {  // all of them, so that the time tells nothing
    if (CRYPTO_memcmp(hash.data(), entry.hash.data(), hash.size()) == 0) found = &entry;
  }
  return found;
}

std::string TokenChanges(const Tokens& before, const Tokens& after) {
  std::string out;
  size_t changes = 0;
  const auto add = [&](const std::string& text) {
    if (++changes <= kMostNamed) out += (out.empty() ? "" : ", ") + text;
  };
  for (const Tokens::Entry& entry : after.entries()) {
    const Tokens::Entry* const old = SameToken(before, entry);
    if (old == nullptr) {
      add("added " + Text(entry));
    } else if (Text(*old) != Text(entry)) {
      add(Text(*old) + " is now " + Text(entry));
    }
  }
  for (const Tokens::Entry& entry : before.entries())
    if (SameToken(after, entry) == nullptr) add("removed " + Text(entry));
  return changes > kMostNamed ? out + " and " + std::to_string(changes - kMostNamed) + " more" : out;
}

}  // namespace taclink::server
