#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "sensing/core/baseline.h"
#include "taclink/v1/frame.pb.h"

namespace taclink::command {

/// Of numbers that are not negative.
struct Spread {
  uint64_t count = 0;
  double sum = 0;
  double most = 0;

  void Add(double value) {
    ++count;
    sum += value;
    most = std::max(most, value);
  }
  double mean() const { return count > 0 ? sum / static_cast<double>(count) : 0; }
};

/// How the new results of frames that were measured both times are off the recorded ones.
struct FrameDifferences {
  uint64_t frames = 0;
  Spread marker_mm;  ///< of each marker's place; of none where the model has another number of them
  Spread force_n;    ///< of the total force, as a vector
  uint64_t other_contacts = 0;  ///< frames with another number of contacts
};

/// From this frame on results are against another baseline than the recorded ones, so that their difference
/// says little.
struct BaselineBreak {
  uint64_t sequence = 0;
  double after_s = 0;  ///< since the link's first frame in the log
  Baseline recorded, solved;
};

/// What came of one link.
struct LinkReport {
  std::string name;
  bool from_pictures = true;                        ///< false: from the recorded markers
  std::map<std::string, std::string> changes = {};  ///< settings that are not the recorded ones
  std::vector<std::string> warnings = {};
  uint64_t frames = 0;     ///< with a picture, when they were recorded
  uint64_t solved = 0;     ///< the others have nothing to solve in the log, and stay as they are
  uint64_t identical = 0;  ///< of the solved ones
  uint64_t lost = 0;       ///< that the log says are missing
  /// Solved ones that were measured only then, or only now.
  uint64_t only_recorded = 0, only_solved = 0;
  FrameDifferences same_baseline = {}, other_baseline = {};
  std::vector<BaselineBreak> breaks = {};
  double solve_s = 0;     ///< of all solved frames
  double recorded_s = 0;  ///< from the first exposure to the last
};

/// Counts a solved frame. `recorded_bytes`: of `recorded`. `solved` has the recorded times. Identical are
/// frames that differ at most in how long the stages took and in the reason `late_frame`: all else follows
/// from the pictures, their times and the settings.
void Compare(const v1::LinkFrame& recorded, const std::string& recorded_bytes, double after_s,
             const v1::LinkFrame& solved, LinkReport& report);

}  // namespace taclink::command
