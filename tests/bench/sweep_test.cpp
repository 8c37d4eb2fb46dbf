#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bench/sweep/sweep_bench.h"
#include "bench/sweep/sweep_report.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

SweepContact ContactWith(double true_n, double error_n, double center_mm) {
  return {.unit = {.model = "cylinder", .pressure_kpa = 0.5, .path = 3},
          .ring = 4,
          .depth_mm = 2.5,
          .true_n = true_n,
          .has_forces = true,
          .is_ok = true,
          .found_n = true_n,
          .force_error_n = error_n,
          .center_error_mm = center_mm};
}

TEST(SweepReport, CountsStrongForcesAndAllCenters) {
  std::vector<SweepContact> contacts;
  for (int i = 1; i <= 100; ++i) contacts.push_back(ContactWith(0.5, 0.5 * i / 100, i));
  contacts.push_back(ContactWith(0.1, 0.1, 200));  // too weak a force to count
  SweepContact silent = ContactWith(0.5, 0, 0);
  silent.has_forces = silent.is_ok = false;
  contacts.push_back(silent);
  SweepContact missed = ContactWith(0.5, 0.5, 0);
  missed.found_n = 0;
  contacts.push_back(missed);
  SweepContact degraded = ContactWith(0.2, 0, 1);
  degraded.is_ok = false;
  degraded.found_n = 0;
  degraded.phantom_n = 0.2;
  contacts.push_back(degraded);
  const SweepSummary sum = SummarizeSweep(contacts);
  EXPECT_EQ(sum.contacts, 104u);
  EXPECT_EQ(sum.answered, 103u);
  EXPECT_EQ(sum.phantom_n, 0.2);
  EXPECT_EQ(sum.ok_phantom_n, 0);
  // 90 errors above 10 %, 6 centers beyond 4 mm with a smaller error, the weak and the missed one.
  EXPECT_EQ(sum.silently_wrong, 98u);
  EXPECT_EQ(sum.missed, 1u);
  EXPECT_EQ(sum.force_share.count, 101u);
  EXPECT_NEAR(sum.force_share.median, 0.51, 1e-9);
  EXPECT_NEAR(sum.force_share.p95, 0.96, 1e-9);
  EXPECT_EQ(sum.center_mm.median, 51);
  EXPECT_EQ(sum.least_n, 0.5);
}

TEST(SweepReport, ContactsAreReadAsTheyWereWritten) {
  SweepContact contact = ContactWith(0.5, 0.01, 1.5);
  contact.is_cell = true;
  contact.is_ok = false;
  contact.reasons = "drift few_markers";
  contact.balance_n = 0.02;
  const auto read = ParseSweepCsv(SweepCsvHeader() + SweepCsvRow(contact));
  ASSERT_TRUE(read.ok()) << read.error().message;
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ(SweepCsvRow(read->front()), SweepCsvRow(contact));
  EXPECT_TRUE(UnitsOf(*read).contains(contact.unit));
  EXPECT_EQ(ParseSweepCsv(SweepCsvHeader() + "cylinder,0.5\n").error().message, "line 2 is not of a sweep");
}

TEST(SweepUnits, HoldEveryPathOnce) {
  const LinkModel cylinder = LoadLinkModel("cylinder").value(), barrel = LoadLinkModel("barrel").value();
  const std::vector<SweepUnit> units = SweepUnits({cylinder, barrel}, {0, 1});
  const size_t paths = static_cast<size_t>(cylinder.markers.paths + barrel.markers.paths);
  EXPECT_EQ(units.size(), 2 * paths);
  EXPECT_EQ(std::set<SweepUnit>(units.begin(), units.end()).size(), 2 * paths);
  // The first eighth covers both skins at both pressures.
  std::set<std::pair<std::string, double>> first;
  for (size_t i = 0; i < units.size() / 8; ++i) first.emplace(units[i].model, units[i].pressure_kpa);
  EXPECT_EQ(first.size(), 4u);
}

// Some places of one path, from images: what the whole sweep does, at the price of a test.
TEST(Sweep, AnswersAtThePlacesOfAPath) {
  LinkModel model = LoadLinkModel("cylinder").value();
  std::vector<SweepContact> contacts;
  std::string failure;
  RunSweep({model},
           {.units = {{.model = "cylinder", .pressure_kpa = 1, .path = 5}},
            .jobs = 1,
            .done = [&](const auto& some, const std::string& why) { contacts = some, failure = why; }});
  EXPECT_EQ(failure, "");
  ASSERT_EQ(contacts.size(), static_cast<size_t>(3 * (2 * model.markers.rings() - 1)));
  const SweepSummary sum = SummarizeSweep(contacts);
  EXPECT_EQ(sum.missed, 0u);
  EXPECT_LT(sum.center_mm.median, 3);
  EXPECT_LT(sum.force_share.median, 0.1);
}

}  // namespace
}  // namespace taclink
