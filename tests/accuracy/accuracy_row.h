#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_state.h"
#include "tests/accuracy/solid_scenes.h"

namespace taclink {

/// How an answer compares with the truth.
enum class Verdict {
  kHolds,     ///< within the limits of JudgeContacts
  kReported,  ///< not, and the state says so: its status is not `ok`
  kSilent,    ///< not, and its status is `ok`
};

/// One line of tests/accuracy/report.csv: a scene as seen through one kind of input.
struct AccuracyRow {
  std::string input;  ///< a MarkerCondition's name, or "images"
  std::string scene, family;
  bool held_out = false;
  Verdict verdict = Verdict::kReported;
  double force_error_n = 0,
         center_error_mm = 0;  ///< as SolidVerdict; an answer without contacts: all is missing
  bool is_ok = false;          ///< status
  double shape_rms_mm = 0, shape_worst_mm = 0;  ///< of the markers' displacements; not in the report
  int forces = 0, within_2_sigma = 0;  ///< contacts near a body, by their covariance; not in the report
  std::string fault;                   ///< in words; not in the report
};

/// Judges the contacts of a state; a state that is not measured has no answer.
AccuracyRow MakeRow(const std::string& input, const SolidScene& scene, const LinkState& state);

struct AccuracyShares {
  int rows = 0, ok = 0, holds = 0, silent = 0;
  double Holds() const { return rows > 0 ? static_cast<double>(holds) / rows : 0; }
  double Silent() const { return rows > 0 ? static_cast<double>(silent) / rows : 0; }
};
AccuracyShares SharesOf(const std::vector<AccuracyRow>& rows);

/// "input,scene,..." and one line of a row, without line ends.
std::string CsvHeader();
std::string CsvLine(const AccuracyRow& row);

}  // namespace taclink
