#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
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

  /// Lines of `NAME ROLE SHA256 [expires=TIME]`, role viewer or operator, the hash in hexadecimal, the time
  /// as ParseUtc reads it; '#' begins a comment. `name` stands for the file in messages. Errors:
  /// kInvalidArgument with file and line.
  static Result<Tokens> Parse(const std::string& name, std::string_view text);

  /// Null: not known.
  const Entry* Find(std::string_view token) const;
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  static Result<Entry> ParseLine(std::string_view line);
  static Hash HashOf(std::string_view token);

  std::vector<Entry> entries_;
};

/// What became of `before`, by name and without anything secret: "added eve (viewer)", ... Empty: nothing
/// that matters.
std::string TokenChanges(const Tokens& before, const Tokens& after);

}  // namespace taclink::server
