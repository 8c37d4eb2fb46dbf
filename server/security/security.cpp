#include "server/security/security.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "server/thread_setup.h"

namespace taclink::server {
namespace {

constexpr std::chrono::seconds kWatchInterval{1};

bool SameWord(std::string_view a, std::string_view lower) {
  if (a.size() != lower.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    const char c = a[i] >= 'A' && a[i] <= 'Z' ? static_cast<char>(a[i] - 'A' + 'a') : a[i];
    if (c != lower[i]) return false;
  }
  return true;
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

Result<std::shared_ptr<Security>> Security::Load(const SecurityConfig& config) {
  std::shared_ptr<Security> out(new Security(config));
  const std::lock_guard lock(out->reload_mutex_);
  const auto read = out->Read();
  if (!read) return read.error();
  return out;
}

Security::~Security() {
  watcher_.request_stop();
}

Result<Caller> Security::Check(std::string_view path, std::string_view authorization) const {
  if (!needs_token()) return Caller{"", Role::kOperator};
  const Role needed = NeededRole(path);
  if (needed == Role::kNobody) return Identify(authorization);
  const std::string_view token = BearerToken(authorization);
  if (token.empty())
    return Error{ErrorCode::kUnauthenticated,
                 "this server asks for a token: send 'authorization: Bearer TOKEN' (taclink: --token or "
                 "TACLINK_TOKEN)"};
  const auto caller = Find(token);
  if (!caller)
    return Error{ErrorCode::kUnauthenticated, "the token is not known to this server; ask for a new one"};
  if (caller->role < needed)
    return Error{ErrorCode::kPermissionDenied,
                 "'" + caller->name + "' is a viewer, but " + std::string(path) + " is for operators"};
  return *caller;
}

std::optional<Caller> Security::Find(std::string_view token) const {
  const auto tokens = [this] {
    const std::lock_guard lock(mutex_);
    return tokens_;
  }();
  const Caller* const caller = tokens->Find(token);
  return caller == nullptr ? std::nullopt : std::optional(*caller);
}

Caller Security::Identify(std::string_view authorization) const {
  if (!needs_token()) return {"", Role::kOperator};
  const std::string_view token = BearerToken(authorization);
  return token.empty() ? Caller{} : Find(token).value_or(Caller{});
}

std::string Security::NameOf(std::string_view authorization) const {
  return Identify(authorization).name;
}

std::shared_ptr<const TlsMaterial> Security::tls() const {
  const std::lock_guard lock(mutex_);
  return tls_;
}

Result<void> Security::Read() {
  std::shared_ptr<const TlsMaterial> tls;
  if (!config_.certificate.empty()) {
    auto material = ReadTlsFiles(config_);
    if (!material) return material.error();
    const std::string warnings = TlsWarnings(config_, *material);
    if (!warnings.empty() && warnings != warnings_) spdlog::warn("security: {}", warnings);
    warnings_ = warnings;
    tls = std::make_shared<const TlsMaterial>(std::move(*material));
  }
  std::shared_ptr<const Tokens> tokens;
  std::string text;
  if (needs_token()) {
    auto read = ReadSecurityFile("security.tokens", config_.tokens);
    if (!read) return read.error();
    text = std::move(*read);
    auto parsed = Tokens::Parse(config_.tokens, text);
    if (!parsed) return parsed.error();
    tokens = std::make_shared<const Tokens>(std::move(*parsed));
  }
  const std::lock_guard lock(mutex_);
  const bool first = !tls_ && !tokens_;
  if (tls && (!tls_ || *tls != *tls_)) {
    if (!first) spdlog::info("security: certificates read anew");
    tls_ = std::move(tls);
  }
  if (tokens && text != token_text_) {
    if (!first) spdlog::info("security: {} tokens read anew", tokens->size());
    tokens_ = std::move(tokens);
    token_text_ = std::move(text);
  }
  return {};
}

void Security::Reload() {
  const std::lock_guard lock(reload_mutex_);
  const auto read = Read();
  const std::string complaint = read ? "" : read.error().message;
  if (complaint != complaint_ && !read)
    spdlog::error("security: {}; what was read before stays in use", complaint);
  complaint_ = complaint;
}

void Security::Watch() {
  if (config_.certificate.empty() && !needs_token()) return;
  watcher_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void Security::Run(const std::stop_token& stop) {
  SetUpThread("security", {});
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (stopped_.wait_for(lock, stop, kWatchInterval, [] { return false; }) || stop.stop_requested())
        return;
    }
    Reload();
  }
}

}  // namespace taclink::server
