#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/vision/vision_report.h"
#include "sensing/acceptance/acceptance_report.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// The flaw of a simulated link, in addition to noise, jitter and the estimator's own errors.
enum class LinkFlaw : uint8_t {
  kNone,
  kModulus,   ///< the model's Young's modulus is wrong by 10 %
  kPressure,  ///< the pressure sensor's gain is wrong by 5 %
  kMounting,  ///< the link is turned by 5 degrees relative to the references
  kCamera,    ///< one camera moved by 0.3 mm since the calibration
  kCreep,     ///< the skin creeps by 8 % within 60 s; the model has no relaxation
};
inline constexpr const char* kLinkFlawNames[] = {"none",     "modulus", "pressure",
                                                 "mounting", "camera",  "creep"};
inline constexpr int kLinkFlaws = 6;

/// A reported quantity whose true value is known from the flaw.
struct AcceptanceClaim {
  std::string quantity;
  double truth = 0, value = 0, low = 0, high = 0;  ///< in the quantity's unit
  bool holds() const { return low <= truth && truth <= high; }
};

/// The acceptance of one simulated link from images.
struct AcceptanceOutcome {
  uint64_t seed = 0;
  LinkFlaw flaw = LinkFlaw::kNone;
  bool is_negative = false;  ///< the flaw has a negative sign
  AcceptanceRecord record;
  AcceptanceReport report;
  std::vector<AcceptanceClaim> claims;
  bool is_found = false;              ///< the flaw is among the findings
  std::vector<FindingId> false_ones;  ///< findings that the flaw does not explain
  double cpu_s = 0;
  std::string failure;  ///< why the skin could not be simulated; there is no report then
};

struct AcceptanceBenchOptions {
  int links = 100;
  int first = 0;  ///< seed of the first link
  int jobs = 1;
  std::function<void(const AcceptanceOutcome&)> done = {};  ///< called one at a time; may be empty
};

/// Accepts simulated links from rendered images; flaw, places and noise differ from link to link. The
/// reference loads are the simulation's true ones; the flaw is known only to the bench.
std::vector<AcceptanceOutcome> RunAcceptanceBench(const LinkModel& model,
                                                  const AcceptanceBenchOptions& options);

/// One row per flaw: links in which it was found, false findings, and intervals that contain the truth.
ReportTable AcceptanceTable(const std::vector<AcceptanceOutcome>& outcomes);

}  // namespace taclink
