#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include "sensing/core/result.h"
#include "server/config_security.h"
#include "server/security/tls_files.h"
#include "server/security/tokens.h"

namespace taclink::server {

/// Who may call, and what TLS needs: as configured, read anew when the files change. All of it may be called
/// by any thread.
class Security {
 public:
  /// Nothing is configured: everybody is an operator, no TLS.
  Security() = default;
  /// Errors: a file that is missing or wrong.
  static Result<std::shared_ptr<Security>> Load(const SecurityConfig& config);
  ~Security();

  /// Whether the caller that sent this `authorization` header may call `path` (see AccessTable), and who it
  /// is. Errors: kUnauthenticated (no token, or not known), kPermissionDenied.
  Result<Caller> Check(std::string_view path, std::string_view authorization) const;

  /// Who sent that header; nobody, where it holds no token that is known.
  Caller Identify(std::string_view authorization) const;
  /// Whose token that header holds; empty: none that is known.
  std::string NameOf(std::string_view authorization) const;

  /// Null: no TLS. A new object after each change.
  std::shared_ptr<const TlsMaterial> tls() const;
  bool needs_token() const { return !config_.tokens.empty(); }

  /// Reads the files again. What is wrong is logged once and what was there before stays in use.
  void Reload();
  /// Reloads once a second from now on.
  void Watch();

 private:
  explicit Security(SecurityConfig config) : config_(std::move(config)) {}
  /// None: not known.
  std::optional<Caller> Find(std::string_view token) const;
  Result<void> Read();
  void Run(const std::stop_token& stop);

  // Constant after construction.
  const SecurityConfig config_;

  std::mutex reload_mutex_;
  // Guarded by reload_mutex_.
  std::string complaint_;  // of the last Reload
  std::string warnings_;
  std::string token_text_;

  mutable std::mutex mutex_;
  std::condition_variable_any stopped_;
  // Guarded by mutex_.
  std::shared_ptr<const Tokens> tokens_;
  std::shared_ptr<const TlsMaterial> tls_;

  std::jthread watcher_;
};

/// The token of an `authorization: Bearer TOKEN` header; empty: it is no such header.
std::string_view BearerToken(std::string_view authorization);

}  // namespace taclink::server
