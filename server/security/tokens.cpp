#include "server/security/tokens.h"

#include <openssl/sha.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <utility>

#include "sensing/core/name.h"
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

// The first of many, and how many there are beyond these: a list for the log and the audit.
class ShortList {
 public:
  template <typename MakeText>
  void Add(const MakeText& make_text) {
    if (++count_ <= kMostNamed) text_ += (text_.empty() ? "" : ", ") + make_text();
  }
  std::string text() const {
    return count_ <= kMostNamed ? text_ : text_ + " and " + std::to_string(count_ - kMostNamed) + " more";
  }

 private:
  size_t count_ = 0;
  std::string text_;
};

bool SameRights(const Tokens::Entry& a, const Tokens::Entry& b) {
  return a.caller.name == b.caller.name && a.caller.role == b.caller.role &&
         a.expires_utc_s == b.expires_utc_s;
}

// The next word, which is taken off `line`; empty: there is none.
std::string_view NextWord(std::string_view& line) {
  constexpr std::string_view kBlanks = " \t\r\v\f";
  line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
  line.remove_prefix(word.size());
  return word;
}

Result<std::optional<int64_t>> ParseExpiry(std::string_view word) {
  if (word.empty()) return std::optional<int64_t>();
  const auto time = word.starts_with(kExpires) ? ParseUtc(word.substr(kExpires.size())) : std::nullopt;
  if (!time)
    return Error{ErrorCode::kInvalidArgument,
                 "after the SHA-256 only 'expires=2027-01-31T00:00:00Z' may stand (UTC; or the date alone)"};
  return time;
}

}  // namespace

Result<Tokens::Entry> Tokens::ParseLine(std::string_view line) {
  const std::string_view name = NextWord(line), role = NextWord(line), hash = NextWord(line),
                         expiry = NextWord(line);
  Entry entry;
  if (hash.empty() || !NextWord(line).empty())
    return Error{ErrorCode::kInvalidArgument,
                 "must be 'NAME ROLE SHA256-OF-TOKEN [expires=TIME]'; 'taclink token new' makes such a line"};
  if (const auto good = CheckName(name); !good)
    return Error{good.error().code, "the name " + good.error().message};
  entry.caller.name = name;
  if (role != "viewer" && role != "operator")
    return Error{ErrorCode::kInvalidArgument,
                 "the role must be viewer or operator, not '" + std::string(role) + "'"};
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
  for (int number = 1; !text.empty(); ++number) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    line = line.substr(0, line.find('#'));
    if (std::string_view rest = line; NextWord(rest).empty()) continue;
    const auto complaint = [&](const std::string& what) {
      return Error{ErrorCode::kInvalidArgument, name + ":" + std::to_string(number) + ": " + what};
    };
    auto entry = ParseLine(line);
    if (!entry) return complaint(entry.error().message);
    const auto [at, is_new] = tokens.by_hash_.emplace(entry->hash, tokens.entries_.size());
    if (!is_new)
      return complaint("is the same token as '" + tokens.entries_[at->second].caller.name +
                       "' has above; remove one of the lines");
    tokens.entries_.push_back(std::move(*entry));
  }
  if (tokens.entries_.empty())
    return Error{ErrorCode::kInvalidArgument,
                 name + ": holds no token, so that nobody could call; 'taclink token new' makes its lines"};
  return tokens;
}

size_t Tokens::HashBytes::operator()(const Hash& hash) const {
  size_t out = 0;
  std::memcpy(&out, hash.data(), sizeof out);  // any bytes of a SHA-256 are a good hash
  return out;
}

Tokens::Hash Tokens::HashOf(std::string_view token) {
  Hash hash;
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  return hash;
}

const Tokens::Entry* Tokens::Find(std::string_view token) const {
  return FindHash(HashOf(token));
}

const Tokens::Entry* Tokens::FindHash(const Hash& hash) const {
  const auto at = by_hash_.find(hash);
  return at == by_hash_.end() ? nullptr : &entries_[at->second];
}

std::string TokenChanges(const Tokens& before, const Tokens& after) {
  ShortList changes;
  for (const Tokens::Entry& entry : after.entries()) {
    const Tokens::Entry* const old = before.FindHash(entry.hash);
    if (old == nullptr) {
      changes.Add([&] { return "added " + Text(entry); });
    } else if (!SameRights(*old, entry)) {
      changes.Add([&] { return Text(*old) + " is now " + Text(entry); });
    }
  }
  for (const Tokens::Entry& entry : before.entries())
    if (after.FindHash(entry.hash) == nullptr) changes.Add([&] { return "removed " + Text(entry); });
  return changes.text();
}

std::string ExpiredBetween(const Tokens& tokens, int64_t before_utc_s, int64_t now_utc_s) {
  ShortList names;
  for (const Tokens::Entry& entry : tokens.entries())
    if (entry.ExpiredAt(now_utc_s) && !entry.ExpiredAt(before_utc_s))
      names.Add([&] { return entry.caller.name; });
  return names.text().empty() ? std::string() : "expired: " + names.text();
}

}  // namespace taclink::server
