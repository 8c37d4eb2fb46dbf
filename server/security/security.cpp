#include "server/security/security.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "sensing/core/thread_start.h"
#include "sensing/core/utc_time.h"
#include "server/process/system_limits.h"
#include "server/security/secret_file.h"

namespace taclink::server {
namespace {

constexpr std::chrono::seconds kWatchInterval{1};
constexpr size_t kMostChanges = 16;
constexpr int64_t kNsPerSecond = 1'000'000'000;

bool SameWord(std::string_view a, std::string_view lower) {
  if (a.size() != lower.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    const char c = a[i] >= 'A' && a[i] <= 'Z' ? static_cast<char>(a[i] - 'A' + 'a') : a[i];
    if (c != lower[i]) return false;
  }
  return true;
}

// Which files of TLS are others than before.
std::string TlsChanges(const TlsMaterial& before, const TlsMaterial& after) {
  std::string out;
  const auto add = [&](const char* name, bool changed) {
    if (changed) out += (out.empty() ? "" : ", ") + std::string(name);
  };
  add("certificate", before.certificate != after.certificate);
  add("key", before.key != after.key);
  add("client_ca", before.client_ca != after.client_ca);
  return out.empty() ? out : out + " reloaded";
}

void Count(const Tokens& tokens, int64_t now_s, SecurityStatus& out) {
  for (const Tokens::Entry& entry : tokens.entries()) {
    ++(entry.ExpiredAt(now_s) ? out.expired : out.tokens);
    if (entry.expires_utc_s && !entry.ExpiredAt(now_s))
      out.next_expiry_utc_s =
          std::min(out.next_expiry_utc_s.value_or(*entry.expires_utc_s), *entry.expires_utc_s);
  }
}

// Memory that cannot be had says no more of a file than an error of the disk.
template <typename Read>
Result<std::string> Guarded(const Read& read) {
  try {
    return read();
  } catch (const std::exception& e) {
    return Error{ErrorCode::kUnavailable, "cannot be read again now: " + DescribeLimit(e)};
  }
}

}  // namespace

std::string_view BearerToken(std::string_view authorization) {
  constexpr std::string_view kScheme = "bearer";
  if (authorization.size() <= kScheme.size() || !SameWord(authorization.substr(0, kScheme.size()), kScheme))
    return {};
  authorization.remove_prefix(kScheme.size());
  if (authorization.front() != ' ') return {};
  const auto begin = authorization.find_first_not_of(' ');
  return begin == std::string_view::npos ? std::string_view() : authorization.substr(begin);
}

Security::Security(SecurityConfig config, Clock& clock)
    : config_(std::move(config)), clock_(clock), tries_(config_.max_failed_tries) {}

Result<std::shared_ptr<Security>> Security::Load(const SecurityConfig& config, Clock& clock) {
  std::shared_ptr<Security> out(new Security(config, clock));
  const std::lock_guard lock(out->reload_mutex_);
  for (const auto& read : {out->ReadTls(), out->ReadTokens()}) {
    if (!read) return read.error();
    if (!read->empty()) SPDLOG_WARN("security: {}", *read);  // has expired already
  }
  return out;
}

Result<Caller> Security::Check(std::string_view path, std::string_view authorization,
                               const std::string& place) const {
  if (!needs_token()) return Caller{"", Role::kOperator};
  const Role needed = NeededRole(path);
  const std::string_view token = BearerToken(authorization);
  const Found found = Find(token);
  if (found.caller.role == Role::kNobody) {
    if (needed == Role::kNobody && token.empty()) return found.caller;
    const Error refusal = Refuse(found, token, place);  // counted also where nobody has to be known
    return needed == Role::kNobody ? Result<Caller>(found.caller) : refusal;
  }
  if (found.caller.role < needed)
    return Error{ErrorCode::kPermissionDenied,
                 "'" + found.caller.name + "' is a viewer, but " + std::string(path) + " is for operators"};
  return found.caller;
}

Security::Found Security::Find(std::string_view token) const {
  if (token.empty())
    return {.caller = {},
            .why_not =
                "this server asks for a token: send 'authorization: Bearer TOKEN' (taclink: --token or "
                "TACLINK_TOKEN)",
            .count = &without_};
  const auto tokens = [this] {
    const std::lock_guard lock(mutex_);
    return tokens_;
  }();
  if (!tokens) return {};
  const Tokens::Entry* const entry = tokens->Find(token);
  if (entry == nullptr)
    return {.caller = {},
            .why_not = "the token is not known to this server; ask for a new one",
            .count = &unknown_};
  if (entry->ExpiredAt(clock_.UtcNs() / kNsPerSecond))
    return {.caller = {},
            .why_not = "the token of '" + entry->caller.name + "' has expired at " +
                       UtcText(*entry->expires_utc_s) + "; ask for a new one",
            .count = &expired_};
  return {.caller = entry->caller, .why_not = {}};
}

Error Security::Refuse(const Found& found, std::string_view token, const std::string& place) const {
  if (found.count == nullptr)
    return {ErrorCode::kFailedPrecondition,
            "this server cannot tell whose tokens are good: its token file is in error; its log says how"};
  ++*found.count;
  if (token.empty()) return {ErrorCode::kUnauthenticated, found.why_not};
  const FailedTries::Verdict verdict = tries_.Count(place, clock_.MonotonicNs());
  if (verdict.tell) {
    const std::string text = fmt::format("more than {} tries a minute with tokens that are not good from {}",
                                         config_.max_failed_tries, place.empty() ? "unknown" : place);
    SPDLOG_WARN("security: {}", text);
    if (listener_) listener_(false, text);
  }
  if (!verdict.too_many) return {ErrorCode::kUnauthenticated, found.why_not};
  return {ErrorCode::kResourceExhausted, found.why_not + "; more than " +
                                             std::to_string(config_.max_failed_tries) +
                                             " such tries came from there within a minute: wait one"};
}

Caller Security::Identify(std::string_view authorization) const {
  if (!needs_token()) return {"", Role::kOperator};
  return Find(BearerToken(authorization)).caller;
}

std::shared_ptr<const TlsMaterial> Security::tls() const {
  const std::lock_guard lock(mutex_);
  return tls_;
}

SecurityStatus Security::Status() const {
  SecurityStatus out;
  std::shared_ptr<const Tokens> tokens;
  {
    const std::lock_guard lock(mutex_);
    for (const Part* part : {&tls_part_, &token_part_, &expiry_part_})
      if (!part->complaint.empty()) out.trouble += (out.trouble.empty() ? "" : "; ") + part->complaint;
    tokens = tokens_;
  }
  if (tokens) Count(*tokens, clock_.UtcNs() / kNsPerSecond, out);  // calls do not wait for it
  out.refuses_all = needs_token() && out.tokens == 0;
  out.tries_without = without_;
  out.tries_unknown = unknown_;
  out.tries_expired = expired_;
  out.tries_throttled = tries_.throttled();
  return out;
}

Result<std::string> Security::ReadTls() {
  if (config_.certificate.empty()) return std::string();
  auto material = ReadTlsFiles(config_);
  if (!material) return material.error();
  const std::string warnings = TlsWarnings(config_, *material);
  if (!warnings.empty() && warnings != warnings_) SPDLOG_WARN("security: {}", warnings);
  warnings_ = warnings;
  const std::lock_guard lock(mutex_);
  if (tls_ && *tls_ == *material) return std::string();
  const auto before = std::exchange(tls_, std::make_shared<const TlsMaterial>(std::move(*material)));
  return before ? TlsChanges(*before, *tls_) : std::string();
}

Result<std::string> Security::ReadTokens() {
  if (!needs_token()) return std::string();
  const auto text = config_.tokens_open ? ReadSecurityFile("security.tokens", config_.tokens)
                                        : ReadSecretFile("security.tokens", config_.tokens);
  if (!text) return text.error();
  std::string changes;
  if (!good_tokens_ || *text != token_text_) {
    auto tokens = Tokens::Parse(config_.tokens, *text);
    if (!tokens) return tokens.error();
    const auto before = std::exchange(good_tokens_, std::make_shared<const Tokens>(std::move(*tokens)));
    token_text_ = *text;
    if (before) changes = TokenChanges(*before, *good_tokens_);
  }
  const int64_t now_s = clock_.UtcNs() / kNsPerSecond;
  const std::string expired = ExpiredBetween(*good_tokens_, std::exchange(tokens_read_s_, now_s), now_s);
  if (!expired.empty()) changes += (changes.empty() ? "" : "; ") + expired;
  const std::lock_guard lock(mutex_);
  tokens_ = good_tokens_;
  return changes;
}

void Security::Tell(Part& part, const Result<std::string>& read, const char* consequence) {
  const std::string complaint = read ? "" : read.error().message + "; " + consequence;
  const std::string before = [&] {
    const std::lock_guard lock(mutex_);
    return std::exchange(part.complaint, complaint);
  }();
  const auto tell = [&](bool good, const std::string& text) {
    good ? SPDLOG_INFO("security: {}", text) : SPDLOG_ERROR("security: {}", text);
    if (listener_) listener_(good, text);
  };
  if (!complaint.empty() && complaint != before) tell(false, complaint);
  if (complaint.empty() && !before.empty()) tell(true, std::string(part.name) + ": good again");
  if (!read || read->empty()) return;
  changes_.push_back(std::string(part.name) + ": " + *read);
  if (changes_.size() > kMostChanges) changes_.erase(changes_.begin());
  tell(true, changes_.back());
}

void Security::Reload() {
  constexpr const char* kNobody = "nobody's token is taken until it is mended";
  const std::lock_guard lock(reload_mutex_);
  Tell(tls_part_, Guarded([this] { return ReadTls(); }), "what was read before stays in use");
  const auto tokens = Guarded([this] { return ReadTokens(); });
  const bool is_in_use = [&] {
    const std::lock_guard tokens_lock(mutex_);
    if (!tokens && tokens.error().code != ErrorCode::kUnavailable && !config_.tokens_keep) tokens_ = nullptr;
    return tokens_ != nullptr;
  }();
  Tell(token_part_, tokens, is_in_use ? "the tokens that were read before stay in use" : kNobody);
  const SecurityStatus status = Status();
  Tell(expiry_part_,
       status.tokens == 0 && status.expired > 0
           ? Result<std::string>(
                 Error{ErrorCode::kFailedPrecondition, "every token of " + config_.tokens + " has expired"})
           : Result<std::string>(std::string()),
       "nobody is let in; add a new one");
}

std::vector<std::string> Security::TakeChanges() {
  const std::lock_guard lock(reload_mutex_);
  return std::exchange(changes_, {});
}

std::jthread Security::Watch() {
  if (config_.certificate.empty() && !needs_token()) return {};
  return MustStartThread("security", [this](const std::stop_token& stop) { Run(stop); });
}

void Security::Run(const std::stop_token& stop) {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (stopped_.wait_for(lock, stop, kWatchInterval, [] { return false; }) || stop.stop_requested())
        return;
    }
    try {
      Reload();
    } catch (const std::exception& e) {  // the next round may do better
      SPDLOG_ERROR("security: {}", DescribeLimit(e));
    }
  }
}

}  // namespace taclink::server
