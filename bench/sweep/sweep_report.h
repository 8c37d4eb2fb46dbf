#pragma once

#include <set>
#include <span>
#include <string>
#include <vector>

#include "bench/sweep/sweep_bench.h"
#include "bench/vision/vision_report.h"
#include "sensing/core/result.h"

namespace taclink {

/// Median and 95th percentile (nearest rank) of what counts; 0 of none.
struct SweepQuantiles {
  size_t count = 0;
  double median = 0, p95 = 0;
};

/// What a group of contacts amounts to. Forces count from kSweepLeastN on, and only where the link answers;
/// what is answered with a reservation is left out of the `ok_` ones.
struct SweepSummary {
  size_t contacts = 0, answered = 0, ok = 0, missed = 0;  ///< missed: above kSweepLeastN, answered, not found
  SweepQuantiles center_mm, ok_center_mm;
  SweepQuantiles force_share, ok_force_share;  ///< error over the true force
  SweepQuantiles balance_share;                ///< likewise of the sum of all forces
  double least_n = 0, most_n = 0;              ///< of the true forces that count
  double phantom_n = 0;                        ///< the largest
};
inline constexpr double kSweepLeastN = 0.3;

SweepSummary SummarizeSweep(std::span<const SweepContact> contacts);

/// A row for each model and pressure, and one for each depth of it.
ReportTable SweepTable(const std::vector<SweepContact>& contacts);

/// By marker index of one model and pressure: the largest error over the depths. Not a number: no answer, or
/// nothing that counts.
std::vector<double> WorstCenterMm(const LinkModel& model, std::span<const SweepContact> contacts, bool cells);
std::vector<double> WorstForceShare(const LinkModel& model, std::span<const SweepContact> contacts,
                                    bool cells);

/// A line for each contact, with a header. What was written is read back, so that a sweep can go on.
std::string SweepCsvHeader();
std::string SweepCsvRow(const SweepContact& contact);
/// A last line without an end is left out: it was being written. Errors: kInvalidArgument (which line).
Result<std::vector<SweepContact>> ParseSweepCsv(const std::string& text);

/// The contacts of units that have all of theirs: one that was being written when a sweep ended is done
/// again.
std::vector<SweepContact> WholeUnits(const std::vector<LinkModel>& models,
                                     std::vector<SweepContact> contacts);
/// The units of which there are contacts.
std::set<SweepUnit> UnitsOf(std::span<const SweepContact> contacts);

}  // namespace taclink
