#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace taclink::server {

/// Counts calls with tokens that are not good, by where they come from, so that guessing and broken clients
/// are told, and cost little. Keeps a bounded table: places that have no room in it are counted as one. Any
/// thread.
class FailedTries {
 public:
  struct Verdict {
    bool too_many = false;  ///< beyond the limit of this minute
    bool tell = false;      ///< somebody is beyond it, and that was not told within a minute
  };

  /// `a_minute` from one place: 0: no limit.
  explicit FailedTries(int a_minute) : a_minute_(a_minute) {}

  /// One more. `now_ns`: monotonic.
  Verdict Count(const std::string& place, int64_t now_ns);

  uint64_t throttled() const;  ///< that were too many, since the start
  size_t places() const;       ///< in the table

 private:
  struct Entry {
    int64_t begin_ns = 0;
    int tries = 0;
  };
  Entry& Find(const std::string& place, int64_t now_ns);

  const int a_minute_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::map<std::string, Entry> entries_;
  Entry others_;
  uint64_t throttled_ = 0;
  bool told_ = false;
  int64_t told_ns_ = 0;
};

}  // namespace taclink::server
