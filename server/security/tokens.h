#pragma once

#include <array>
#include <cstdint>
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
  /// Lines of `NAME ROLE SHA256`, role viewer or operator, the hash in hexadecimal; '#' begins a comment.
  /// `name` stands for the file in messages. Errors: kInvalidArgument with file and line.
  static Result<Tokens> Parse(const std::string& name, std::string_view text);

  /// Null: not known.
  const Caller* Find(std::string_view token) const;
  size_t size() const { return entries_.size(); }

 private:
  using Hash = std::array<uint8_t, 32>;
  struct Entry {
    Caller caller;
    Hash hash;
  };
  static Result<Entry> ParseLine(std::string_view line);
  static Hash HashOf(std::string_view token);

  std::vector<Entry> entries_;
};

}  // namespace taclink::server
