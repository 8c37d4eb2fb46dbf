#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "sensing/core/clock.h"
#include "sensing/core/result.h"
#include "server/config/options.h"
#include "server/security/failed_tries.h"
#include "server/security/tls_files.h"
#include "server/security/tokens.h"

namespace taclink::server {

/// How the guarding stands, for monitors.
struct SecurityStatus {
  std::string trouble;       ///< what is wrong with its files, with their names; empty: nothing
  bool refuses_all = false;  ///< no token is good now
  size_t tokens = 0;         ///< that are known and have not expired
  size_t expired = 0;
  std::optional<int64_t> next_expiry_utc_s;
  uint64_t tries_without = 0, tries_unknown = 0, tries_expired = 0;  ///< calls refused for their token
  uint64_t tries_throttled = 0;                                      ///< of the latter two, too many
};

/// Who may call, and what TLS needs: as configured, reloaded when the files change. All of it may be called
/// by any thread.
class Security {
 public:
  /// `good`: something was reloaded, or can be again; else something is wrong. `what` holds no secret.
  using Listener = std::function<void(bool good, const std::string& what)>;

  /// Nothing is configured: everybody is an operator, no TLS.
  Security() : Security(SecurityConfig(), SystemClock()) {}
  /// Errors: a file that is missing, wrong or open to others.
  static Result<std::shared_ptr<Security>> Load(const SecurityConfig& config, Clock& clock = SystemClock());

  /// Whether the caller that sent this `authorization` header from `place` may call `path` (see AccessTable),
  /// and who it is. Tokens that are not good are counted by the place; one that is good is let in from
  /// wherever it comes, so that nobody locks out others behind the same address. Errors: kUnauthenticated (no
  /// token, not known, expired), kResourceExhausted (likewise, and too many), kFailedPrecondition (the
  /// token file is in error), kPermissionDenied.
  Result<Caller> Check(std::string_view path, std::string_view authorization, const std::string& place) const;

  /// Who sent that header; nobody, where it holds no token that is good.
  Caller Identify(std::string_view authorization) const;

  /// Null: no TLS. A new object after each change.
  std::shared_ptr<const TlsMaterial> tls() const;
  bool needs_token() const { return !config_.tokens.empty(); }
  SecurityStatus Status() const;

  /// Hears what is logged, too. Before other threads have the object; by any of them.
  void Listen(Listener listener) { listener_ = std::move(listener); }
  /// Reads the files again. What is wrong is told once. Of TLS what was there before stays in use; of tokens
  /// nothing, unless it is configured to, or the error is kUnavailable: this machine could not read the file
  /// now, which says nothing of what is in it.
  void Reload();
  /// What Reload took over since this was last asked, the newest 16.
  std::vector<std::string> TakeChanges();
  /// Reloads once a second until the thread is asked to stop.
  [[nodiscard]] std::jthread Watch();

 private:
  // One of the things that are read, and how it stands.
  struct Part {
    const char* name;
    std::string complaint = {};  // with its consequence; empty: it is good
  };
  struct Found {
    Caller caller;  // nobody: not good
    std::string why_not;
    std::atomic<uint64_t>* count = nullptr;
  };

  Security(SecurityConfig config, Clock& clock);
  Result<std::string> ReadTls();
  Result<std::string> ReadTokens();
  void Tell(Part& part, const Result<std::string>& read, const char* consequence);
  Found Find(std::string_view token) const;
  Error Refuse(const Found& found, std::string_view token, const std::string& place) const;
  void Run(const std::stop_token& stop);

  // Constant after construction.
  const SecurityConfig config_;
  Clock& clock_;
  Listener listener_;

  std::mutex reload_mutex_;
  // Guarded by reload_mutex_.
  std::string warnings_;
  std::string token_text_;
  std::shared_ptr<const Tokens> good_tokens_;  // the last that were
  int64_t tokens_read_s_ = 0;                  // UTC
  std::vector<std::string> changes_;

  mutable std::mutex mutex_;
  std::condition_variable_any stopped_;
  // Guarded by mutex_.
  std::shared_ptr<const Tokens> tokens_;  // null: none is let in
  std::shared_ptr<const TlsMaterial> tls_;
  Part tls_part_{"certificates"}, token_part_{"tokens"}, expiry_part_{"expiry of tokens"};

  mutable FailedTries tries_;
  mutable std::atomic<uint64_t> without_ = 0, unknown_ = 0, expired_ = 0;
};

/// The token of an `authorization: Bearer TOKEN` header; empty: it is no such header.
std::string_view BearerToken(std::string_view authorization);

}  // namespace taclink::server
