#pragma once

#include <set>
#include <span>
#include <string>
#include <vector>

#include "bench/sweep/sweep_bench.h"
#include "bench/vision/vision_report.h"
#include "sensing/core/result.h"

namespace taclink {

/// Median and 95th percentile (nearest rank); 0 without values.
struct SweepQuantiles {
  size_t count = 0;
  double median = 0, p95 = 0;
};

/// Summary of a group of contacts. Forces count from kSweepLeastN on, and only where the link reports forces;
/// the `ok_` members only with status OK.
struct SweepSummary {
  size_t contacts = 0, answered = 0, ok = 0, missed = 0;  ///< missed: from kSweepLeastN, answered, not found
  SweepQuantiles center_mm, ok_center_mm;
  SweepQuantiles force_share, ok_force_share;  ///< error over the true force
  SweepQuantiles balance_share;                ///< likewise of the sum of all forces
  double least_n = 0, most_n = 0;              ///< range of the true forces that count
  double phantom_n = 0, ok_phantom_n = 0;      ///< the largest
  /// Status OK, though the force errs by more than 10 % and 0.03 N, the center by more than 4 mm, or a
  /// phantom exceeds 0.03 N.
  size_t silently_wrong = 0;
};
inline constexpr double kSweepLeastN = 0.3;

SweepSummary SummarizeSweep(std::span<const SweepContact> contacts);

/// One row per model and pressure, and one per depth of it.
ReportTable SweepTable(const std::vector<SweepContact>& contacts);

/// Largest error over the depths, by marker index, for one model and pressure. NaN: no forces reported, or
/// none that count.
std::vector<double> WorstCenterMm(const LinkModel& model, std::span<const SweepContact> contacts, bool cells);
std::vector<double> WorstForceShare(const LinkModel& model, std::span<const SweepContact> contacts,
                                    bool cells);

/// CSV with a header and one line per contact. It is read back to resume a sweep.
std::string SweepCsvHeader();
std::string SweepCsvRow(const SweepContact& contact);
/// A last line without a line end is incomplete and ignored. Errors: kInvalidArgument (which line).
Result<std::vector<SweepContact>> ParseSweepCsv(const std::string& text);

/// The contacts of complete units; a unit that was interrupted is swept again.
std::vector<SweepContact> WholeUnits(const std::vector<LinkModel>& models,
                                     std::vector<SweepContact> contacts);
/// The units of these contacts.
std::set<SweepUnit> UnitsOf(std::span<const SweepContact> contacts);

}  // namespace taclink
