#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sensing/acceptance/acceptance_plan.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_model.h"
#include "server/acceptance/acceptance_messages.h"

namespace taclink::server {

/// What identifies a link for its acceptance.
struct AcceptedLink {
  std::string name;
  LinkModel model;
  std::string model_hash;     ///< of the model's file
  std::string recorded = {};  ///< a finished acceptance from elsewhere, as FinishedFile: from a log
  /// When the cameras in use were calibrated, since 1970-01-01; 0: not known. Any thread.
  std::function<int64_t()> calibrated_utc_ns = {};
};

/// A file that one process at a time holds, until it ends or lets go.
class LockFile {
 public:
  LockFile() = default;
  ~LockFile();
  LockFile(LockFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  LockFile& operator=(LockFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  bool held() const { return descriptor_ >= 0; }
  /// Errors: kUnavailable (the file cannot be made), kFailedPrecondition (another process holds it).
  Result<void> Acquire(const std::string& path);

 private:
  int descriptor_ = -1;
};

/// The acceptances of all links: at most one under way for each, and the last finished one. Every change is
/// written to the folder at once (see ReplaceFile), so that a server that is killed loses no reading. Any
/// thread; calls wait for the disk.
///
///     FOLDER/LINK/current.json    under way
///     FOLDER/LINK/accepted.json   the last finished one; report.html and report.csv beside it
///     FOLDER/LINK/UTC.json        every finished one
///     FOLDER/LINK/lock            held by the server that writes here, from its first change on
class AcceptanceStore {
 public:
  /// `folder` empty: nothing can be accepted. What is in it is read; what cannot be read is logged and stays.
  AcceptanceStore(std::vector<AcceptedLink> links, std::string folder, Clock& clock);

  /// Errors: kFailedPrecondition (no folder, or one that another server uses; another is under way and not
  /// `restart`), kInvalidArgument (the plan), kUnavailable (the disk). `plan_name` for messages; empty text:
  /// the shipped plan of that name.
  Result<v1::Acceptance> Start(size_t link, const std::string& plan_name, const std::string& plan_text,
                               bool restart);

  /// The trial as it stands, with the references that the plan gives it. Errors: kFailedPrecondition (none is
  /// under way), kNotFound (no such trial).
  Result<AcceptanceTrial> Trial(size_t link, uint32_t trial) const;
  /// Claims the link for one measurement; false: one is under way. Until Release the acceptance is neither
  /// replaced nor ended.
  bool Claim(size_t link);
  void Release(size_t link);
  /// Stores a reading. `reference`: with the loaded phase. Errors: as Trial, and kUnavailable (the disk).
  Result<v1::Acceptance> Store(size_t link, uint32_t trial, v1::TrialPhase phase, const TrialReading& reading,
                               const std::optional<TrialReference>& reference);
  Result<v1::Acceptance> Skip(size_t link, uint32_t trial, bool reopen);
  /// Errors: kFailedPrecondition (none is under way, nothing was measured), kUnavailable (the disk).
  Result<v1::Acceptance> Finish(size_t link, bool discard);

  /// Errors: kFailedPrecondition (there is none).
  Result<v1::Acceptance> Get(size_t link, bool finished, bool with_files) const;
  /// Of the last finished one. None: there is none. Does not wait for the disk.
  std::optional<v1::AcceptanceSummary> Summary(size_t link) const;
  /// The file of the last finished one, for logs. Empty: there is none.
  std::string FinishedFile(size_t link) const;

 private:
  struct Entry {
    std::optional<AcceptanceRecord> current, finished;
    std::string current_plan, finished_plan;  ///< texts
    std::string unreadable;  ///< why what is under way cannot be read; empty: it can, or there is none
    bool is_measuring = false;
    LockFile lock;
  };

  /// Of a finished acceptance, with what it holds for.
  struct Summarized {
    v1::AcceptanceSummary summary;
    std::string model_hash;
    int64_t calibrated_utc_ns = 0;
  };

  void Load(size_t link);
  static Result<std::optional<AcceptanceRecord>> LoadRecord(const std::string& path, std::string& plan_text);
  /// `path`: for messages.
  static Result<AcceptanceRecord> Parse(const std::string& path, const std::string& text,
                                        std::string& plan_text);
  Result<v1::Acceptance> Save(size_t link);
  Result<const AcceptanceRecord*> Current(size_t link) const;
  Error IsMeasuring(size_t link) const;
  Result<void> CheckFolder() const;
  Result<void> Own(size_t link);
  std::string PathOf(size_t link, const std::string& file) const;
  int64_t CalibratedUtcNs(size_t link) const;
  void SetSummary(size_t link);

  // Constant after construction.
  const std::vector<AcceptedLink> links_;
  const std::string folder_;
  Clock& clock_;

  mutable std::mutex mutex_;
  std::vector<Entry> entries_;  // by link; guarded by mutex_
  // So that those who ask for summaries do not wait for the disk. Taken after mutex_.
  mutable std::mutex summary_mutex_;
  std::vector<std::optional<Summarized>> summaries_;  // by link; guarded by summary_mutex_
};

}  // namespace taclink::server
