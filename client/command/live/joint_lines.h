#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/result.h"

namespace taclink::command {

inline constexpr size_t kLongestJointLine = size_t{1} << 20;  ///< bytes

/// Joint positions of one line, in rad (prismatic joints: m). `positions` has one number per name;
/// `velocities` (rad/s, m/s) has as many or is empty.
struct JointLine {
  std::optional<double> time_s;  ///< since any instant, at most 1e9 from it; none: the line's own
  std::vector<std::string> names;
  std::vector<double> positions;
  std::vector<double> velocities;
};

/// Reads joint positions line by line: JSON objects ({"time_s": 0.1, "positions": {"elbow": 0.5}}, or
/// "names", "positions" and "velocities" as lists), or CSV whose first line names the columns (a column
/// time_s, if any, and the joints). The first line decides which. A byte order mark before it is skipped.
class JointLineReader {
 public:
  /// None: an empty line, a comment (#), or CSV's first line. Errors: kInvalidArgument, with the line's
  /// number.
  Result<std::optional<JointLine>> Read(const std::string& line);

 private:
  Result<std::optional<JointLine>> ReadJson(const std::string& line);
  Result<std::optional<JointLine>> ReadCsv(const std::string& line);
  Result<void> ReadColumns(std::vector<std::string> names);
  Error Wrong(const std::string& what) const;

  int number_ = 0;
  std::optional<bool> json_;
  std::vector<std::string> columns_;
};

}  // namespace taclink::command
