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

/// Identity of a link for its acceptance.
struct AcceptedLink {
  std::string name;
  LinkModel model;
  std::string model_hash;     ///< fingerprint of the model file
  std::string recorded = {};  ///< finished acceptance from a log (FinishedFile); empty: none
  /// Calibration time of the cameras in use, since 1970-01-01; 0: unknown. Any thread.
  std::function<int64_t()> calibrated_utc_ns = {};
};

/// A file lock that one process holds at a time, until it ends or this object is destroyed.
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
  /// Errors: kUnavailable (the file cannot be created), kFailedPrecondition (another process holds it).
  Result<void> Acquire(const std::string& path);

 private:
  int descriptor_ = -1;
};

/// Acceptances of all links: at most one in progress for each, and the last finished one. Every change is
/// written to the folder at once (ReplaceFile), so that a killed server loses no reading. Any thread; calls
/// wait for the disk.
///
///     FOLDER/LINK/current.json    in progress
///     FOLDER/LINK/accepted.json   the last finished one; with report.html and report.csv
///     FOLDER/LINK/UTC.json        every finished one
///     FOLDER/LINK/lock            lock of the server that writes here, from its first change on
class AcceptanceStore {
 public:
  /// `folder` empty: acceptances are not possible. Reads the folder; files that cannot be read are logged and
  /// kept.
  AcceptanceStore(std::vector<AcceptedLink> links, std::string folder, Clock& clock);

  /// Starts or resumes an acceptance. Errors: kFailedPrecondition (no folder, or one that another server
  /// uses; an acceptance with another plan or model is in progress and not `restart`), kInvalidArgument (the
  /// plan), kUnavailable (the disk). `plan_name`: for messages; with an empty `plan_text`, a shipped plan.
  Result<v1::Acceptance> Start(size_t link, const std::string& plan_name, const std::string& plan_text,
                               bool restart);

  /// The trial; its reference place and direction default to its marker's. Errors: kFailedPrecondition (none
  /// is in progress), kNotFound (no such trial).
  Result<AcceptanceTrial> Trial(size_t link, uint32_t trial) const;
  /// Claims the link for one measurement; false: another one is in progress. Until Release, the acceptance is
  /// neither replaced nor ended.
  bool Claim(size_t link);
  void Release(size_t link);
  /// Stores a reading. `reference`: with the loaded phase. Errors: kFailedPrecondition (none is in progress,
  /// or no such trial), kUnavailable (the disk).
  Result<v1::Acceptance> Store(size_t link, uint32_t trial, v1::TrialPhase phase, const TrialReading& reading,
                               const std::optional<TrialReference>& reference);
  Result<v1::Acceptance> Skip(size_t link, uint32_t trial, bool reopen);
  /// Errors: kFailedPrecondition (none is in progress, a trial is being measured, nothing was measured),
  /// kUnavailable (the disk).
  Result<v1::Acceptance> Finish(size_t link, bool discard);

  /// Errors: kFailedPrecondition (there is none).
  Result<v1::Acceptance> Get(size_t link, bool finished, bool with_files) const;
  /// Summary of the last finished one; none: there is none. Does not wait for the disk.
  std::optional<v1::AcceptanceSummary> Summary(size_t link) const;
  /// File content of the last finished one, for logs; empty: there is none.
  std::string FinishedFile(size_t link) const;

 private:
  struct Entry {
    std::optional<AcceptanceRecord> current, finished;
    std::string current_plan, finished_plan;  ///< YAML texts
    std::string unreadable;                   ///< why current.json cannot be read; empty: readable, or none
    bool is_measuring = false;
    LockFile lock;
  };

  /// Summary of a finished acceptance, with the model and calibration that it is valid for.
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
  // Separate, so that Summary does not wait for the disk. Locked after mutex_.
  mutable std::mutex summary_mutex_;
  std::vector<std::optional<Summarized>> summaries_;  // by link; guarded by summary_mutex_
};

}  // namespace taclink::server
