#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "sensing/core/result.h"
#include "server/security/access.h"

namespace taclink::server {

/// Who called.
struct Caller {
  std::string name;
  Role role = Role::kNobody;
};

/// Bearer tokens that are known, by their SHA-256: the tokens themselves are nowhere.
class Tokens {
 public:
  using Hash = std::array<uint8_t, 32>;
  struct Entry {
    Caller caller;
    Hash hash = {};
    std::optional<int64_t> expires_utc_s = {};  ///< from then on it is of no use

    bool ExpiredAt(int64_t utc_s) const { return expires_utc_s && *expires_utc_s <= utc_s; }
  };

  /// Lines of `NAME ROLE SHA256 [expires=TIME]`, the name as CheckName wants it, role viewer or operator, the
  /// hash in hexadecimal, the time as ParseUtc reads it; '#' begins a comment. `name` stands for the file in
  /// messages. Linear in the size of the text. Errors: kInvalidArgument with file and line.
  static Result<Tokens> Parse(const std::string& name, std::string_view text);

  /// Null: not known. Constant time in the number of tokens.
  const Entry* Find(std::string_view token) const;
  const Entry* FindHash(const Hash& hash) const;
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  // How long a look-up takes depends on the SHA-256 of what a caller sends, not on the token: who cannot
  // choose hashes cannot approach a known one step by step, so that no comparison in constant time is needed.
  struct HashBytes {
    size_t operator()(const Hash& hash) const;
  };
  static Result<Entry> ParseLine(std::string_view line);
  static Hash HashOf(std::string_view token);

  std::vector<Entry> entries_;
  std::unordered_map<Hash, size_t, HashBytes> by_hash_;  // where in entries_
};

/// What became of `before`, by name and without anything secret: "added eve (viewer)", ..., the first 8
/// changes and how many more there are. Empty: nothing that matters.
std::string TokenChanges(const Tokens& before, const Tokens& after);

/// Whose tokens expired after `before_utc_s`, by `now_utc_s`: "expired: eve, otto", likewise shortened.
std::string ExpiredBetween(const Tokens& tokens, int64_t before_utc_s, int64_t now_utc_s);

}  // namespace taclink::server
