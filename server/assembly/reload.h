#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "server/config/config.h"

namespace taclink::server {

/// What of a changed configuration is taken over while the server runs. The rest is named, for it needs a
/// restart.
class Reloader {
 public:
  using Apply = std::function<Result<void>(const Config& next)>;
  struct Outcome {
    std::vector<std::string> applied;        ///< sections that changed and are in use now
    std::vector<std::string> needs_restart;  ///< sections that changed and are not
    std::vector<std::string> errors;         ///< what could not be taken over, and why; the old stays in use
    std::vector<std::string> keys;           ///< that changed since the last reload, see ChangedKeys
  };

  /// kAlways: also where the section did not change, for files that may be others under the same name.
  enum class When { kChanged, kAlways };

  explicit Reloader(const Config& running);

  /// How a top-level section of the configuration is taken over, but for its keys `fixed`, which hold until
  /// the server is started again. Each section has one such hook, so that what it returns is what is reported
  /// of the section; where it fails, the section counts as changed at the next reload, too.
  void Add(const std::string& section, Apply apply, std::vector<std::string> fixed = {},
           When when = When::kChanged);
  /// Called by every reload, for what is no section.
  void AddAlways(const std::string& what, Apply apply);
  /// Any thread; the hooks run within.
  Outcome Reload(const Config& next);

 private:
  struct Hook {
    std::string name;
    Apply apply;
    std::vector<std::string> fixed = {};
    When when = When::kAlways;
  };
  struct Change {
    std::string section, before, after;  // texts; empty: it is not there
  };
  /// Of a changed section, or one whose hook is called always. Returns the text that is in use then.
  const std::string& TakeOver(const Change& change, const Config& next, Outcome& outcome) const;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<Hook> sections_, always_;
  std::string running_;  // text of the configuration in use; where a section was not taken over, the old one
  std::string last_;     // text of the last one that was read
};

/// Top-level sections of a printed configuration: name and text, in their order.
std::vector<std::pair<std::string, std::string>> Sections(const std::string& config_text);

}  // namespace taclink::server
