#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// How strongly a link was pressed at one moment.
struct ForceSample {
  static constexpr size_t kMostContacts = 8;

  int64_t exposure_utc_ns = 0;                                ///< since 1970-01-01
  double total_n = std::numeric_limits<double>::quiet_NaN();  ///< LinkState::total_magnitude_n
  std::array<std::pair<uint64_t, double>, kMostContacts> contacts_n =
      {};  ///< ids and magnitudes; the first ones
  size_t contacts = 0;
};

/// The forces of the last minutes of a link: of each kBinNs the frame with the largest total magnitude. One
/// thread adds, any may read.
class ForceHistory {
 public:
  static constexpr int64_t kBinNs = 100'000'000;
  static constexpr size_t kBins = 3000;  ///< 5 minutes

  /// A frame; one without an exposure time is left out.
  void Add(const LinkState& state);
  /// Samples from a time on, oldest first.
  std::vector<ForceSample> Since(int64_t utc_ns) const;
  /// Of the newest sample; 0: none.
  int64_t newest_utc_ns() const;

 private:
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<ForceSample> ring_;
  size_t next_ = 0;    // place of the next sample, once the ring is full
  int64_t bin_ = 0;    // of the newest sample
  size_t newest_ = 0;  // its place
};

}  // namespace taclink::server
