#include "server/security/tokens.h"

#include <openssl/crypto.h>
#include <openssl/sha.h>

#include <algorithm>
#include <charconv>
#include <sstream>

namespace taclink::server {

Result<Tokens::Entry> Tokens::ParseLine(std::string_view line) {
  std::istringstream words{std::string(line)};
  std::string role, hash, more;
  Entry entry;
  words >> entry.caller.name >> role >> hash;
  if (hash.empty() || words >> more)
    return Error{ErrorCode::kInvalidArgument,
                 "must be 'NAME ROLE SHA256-OF-TOKEN'; 'taclink token' makes such a line"};
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
                 "the token's SHA-256 must be 64 hexadecimal digits; 'taclink token' makes such a line"};
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
    tokens.entries_.push_back(std::move(*entry));
  }
  if (tokens.entries_.empty())
    return Error{ErrorCode::kInvalidArgument,
                 name + ": holds no token, so that nobody could call; 'taclink token' makes its lines"};
  return tokens;
}

Tokens::Hash Tokens::HashOf(std::string_view token) {
  Hash hash;
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  return hash;
}

const Caller* Tokens::Find(std::string_view token) const {
  const Hash hash = HashOf(token);
  const Caller* found = nullptr;
  for (const Entry& entry : entries_) {  // all of them, so that the time tells nothing
    if (CRYPTO_memcmp(hash.data(), entry.hash.data(), hash.size()) == 0) found = &entry.caller;
  }
  return found;
}

}  // namespace taclink::server
