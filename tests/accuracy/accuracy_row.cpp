#include "tests/accuracy/accuracy_row.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "tests/accuracy/solid_judge.h"

namespace taclink {
namespace {

constexpr double kSameBodyMm = 10;

void CountSigmas(const SolidScene& scene, const std::vector<Contact>& found, AccuracyRow& row) {
  for (const SolidContact& body : scene.contacts) {
    for (const Contact& contact : found) {
      if ((contact.center_mm - body.center_mm).norm() > kSameBodyMm || !contact.force_covariance_n2) continue;
      ++row.forces;
      row.within_2_sigma +=
          (contact.force_n - body.force_n).norm() < 2 * std::sqrt(contact.force_covariance_n2->trace());
    }
  }
}

}  // namespace

AccuracyRow MakeRow(const std::string& input, const SolidScene& scene, const LinkState& state) {
  AccuracyRow row;
  row.input = input;
  row.scene = scene.name;
  row.family = scene.family;
  row.held_out = scene.held_out;
  const bool answered = state.measured() && state.forces.converged;
  SolidVerdict judged = JudgeContacts(scene, answered ? state.contacts : std::vector<Contact>());
  row.force_error_n = judged.force_error_n;
  row.center_error_mm = judged.center_error_mm;
  row.fault = answered ? judged.fault : "no answer";
  if (answered) CountSigmas(scene, state.contacts, row);
  row.is_ok = state.status == LinkStatus::kOk;
  row.verdict = row.fault.empty() ? Verdict::kHolds : row.is_ok ? Verdict::kSilent : Verdict::kReported;
  return row;
}

AccuracyShares SharesOf(const std::vector<AccuracyRow>& rows) {
  AccuracyShares shares;
  for (const AccuracyRow& row : rows) {
    ++shares.rows;
    shares.ok += row.is_ok;
    shares.holds += row.verdict == Verdict::kHolds;
    shares.silent += row.verdict == Verdict::kSilent;
  }
  return shares;
}

std::string CsvHeader() {
  return "input,scene,family,held_out,verdict,force_error_n,center_error_mm";
}

std::string CsvLine(const AccuracyRow& row) {
  constexpr std::array kVerdicts = {"holds", "reported", "silent"};
  char numbers[64];
  std::snprintf(numbers, sizeof numbers, "%.2f,%.0f", row.force_error_n, row.center_error_mm);
  return row.input + "," + row.scene + "," + row.family + "," + (row.held_out ? "yes" : "no") + "," +
         kVerdicts[static_cast<size_t>(row.verdict)] + "," + numbers;
}

}  // namespace taclink
