#include "bench/sweep/sweep_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <sstream>
#include <utility>

namespace taclink {
namespace {

constexpr int kColumns = 16;

SweepQuantiles Quantiles(std::vector<double> values) {
  SweepQuantiles out{.count = values.size()};
  if (values.empty()) return out;
  std::ranges::sort(values);
  const auto rank = [&](double share) {
    const double position = std::ceil(share * static_cast<double>(values.size()));
    return values[static_cast<size_t>(std::max(1.0, position)) - 1];
  };
  out.median = rank(0.5);
  out.p95 = rank(0.95);
  return out;
}

std::string Number(double value, const char* format) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string Pair(const SweepQuantiles& quantiles, double factor, const char* format) {
  if (quantiles.count == 0) return "-";
  return Number(factor * quantiles.median, format) + " / " + Number(factor * quantiles.p95, format);
}

std::vector<std::string> Row(const std::string& name, const std::string& what, const SweepSummary& sum) {
  const auto part = [&](size_t count) { return std::to_string(count); };
  return {name,
          what,
          part(sum.contacts),
          part(sum.answered),
          part(sum.ok),
          part(sum.missed),
          Pair(sum.center_mm, 1, "%.1f"),
          Pair(sum.ok_center_mm, 1, "%.1f"),
          Pair(sum.force_share, 100, "%.1f"),
          Pair(sum.ok_force_share, 100, "%.1f"),
          Pair(sum.balance_share, 100, "%.1f"),
          Number(sum.phantom_n, "%.2f"),
          Number(sum.ok_phantom_n, "%.2f"),
          part(sum.silently_wrong),
          sum.most_n > 0 ? Number(sum.least_n, "%.2f") + " to " + Number(sum.most_n, "%.2f") : "-"};
}

bool Holds(const SweepContact& one) {
  const bool is_force_right = one.force_error_n <= std::max(0.1 * one.true_n, 0.03);
  return is_force_right && (one.found_n <= 0 || one.center_error_mm <= 4) && one.phantom_n <= 0.03;
}

template <typename Error>
std::vector<double> Worst(const LinkModel& model, std::span<const SweepContact> contacts, bool cells,
                          Error error) {
  std::vector<double> worst(static_cast<size_t>(model.markers.count()),
                            std::numeric_limits<double>::quiet_NaN());
  for (const SweepContact& contact : contacts) {
    if (contact.is_cell != cells || !contact.has_forces || contact.true_n < kSweepLeastN) continue;
    double& one = worst[static_cast<size_t>(model.MarkerIndex(contact.unit.path - 1, contact.ring - 1))];
    one = std::isnan(one) ? error(contact) : std::max(one, error(contact));
  }
  return worst;
}

}  // namespace

SweepSummary SummarizeSweep(std::span<const SweepContact> contacts) {
  SweepSummary sum;
  std::vector<double> centers, ok_centers, forces, ok_forces, balances;
  sum.contacts = contacts.size();
  for (const SweepContact& one : contacts) {
    if (!one.has_forces) continue;
    ++sum.answered;
    sum.ok += one.is_ok ? 1 : 0;
    sum.phantom_n = std::max(sum.phantom_n, one.phantom_n);
    if (one.is_ok) sum.ok_phantom_n = std::max(sum.ok_phantom_n, one.phantom_n);
    sum.silently_wrong += one.is_ok && !Holds(one) ? 1 : 0;
    if (one.found_n > 0) {
      centers.push_back(one.center_error_mm);
      if (one.is_ok) ok_centers.push_back(one.center_error_mm);
    }
    if (one.true_n < kSweepLeastN) continue;
    sum.missed += one.found_n > 0 ? 0 : 1;
    sum.least_n = sum.least_n > 0 ? std::min(sum.least_n, one.true_n) : one.true_n;
    sum.most_n = std::max(sum.most_n, one.true_n);
    forces.push_back(one.force_error_n / one.true_n);
    balances.push_back(one.balance_n / one.true_n);
    if (one.is_ok) ok_forces.push_back(one.force_error_n / one.true_n);
  }
  sum.center_mm = Quantiles(std::move(centers));
  sum.ok_center_mm = Quantiles(std::move(ok_centers));
  sum.force_share = Quantiles(std::move(forces));
  sum.ok_force_share = Quantiles(std::move(ok_forces));
  sum.balance_share = Quantiles(std::move(balances));
  return sum;
}

ReportTable SweepTable(const std::vector<SweepContact>& contacts) {
  ReportTable table{.title = "Every place",
                    .header = {"skin", "depth", "contacts", "with forces", "ok", "missed", "center, mm",
                               "ok: center, mm", "force, %", "ok: force, %", "balance, %", "phantom, N",
                               "ok: phantom, N", "silently wrong", "forces, N"},
                    .rows = {}};
  std::map<std::pair<std::string, double>, std::vector<SweepContact>> groups;
  for (const SweepContact& one : contacts) groups[{one.unit.model, one.unit.pressure_kpa}].push_back(one);
  for (const auto& [key, group] : groups) {
    const std::string name = key.first + ", " + Number(key.second, "%g") + " kPa";
    std::map<double, std::vector<SweepContact>> depths;
    for (const SweepContact& one : group) depths[one.depth_mm].push_back(one);
    for (const auto& [depth_mm, some] : depths)
      table.rows.push_back(Row(name, Number(depth_mm, "%.1f mm"), SummarizeSweep(some)));
    table.rows.push_back(Row(name, "all", SummarizeSweep(group)));
  }
  if (!contacts.empty()) table.rows.push_back(Row("all", "all", SummarizeSweep(contacts)));
  return table;
}

std::vector<double> WorstCenterMm(const LinkModel& model, std::span<const SweepContact> contacts,
                                  bool cells) {
  return Worst(model, contacts, cells, [](const SweepContact& one) { return one.center_error_mm; });
}

std::vector<double> WorstForceShare(const LinkModel& model, std::span<const SweepContact> contacts,
                                    bool cells) {
  return Worst(model, contacts, cells,
               [](const SweepContact& one) { return one.force_error_n / one.true_n; });
}

std::string SweepCsvHeader() {
  return "model,pressure_kpa,path,ring,is_cell,depth_mm,is_limited,true_n,has_forces,is_ok,found_n,force_"
         "error_n,"
         "center_error_mm,phantom_n,balance_n,reasons\n";
}

std::string SweepCsvRow(const SweepContact& one) {
  std::ostringstream out;
  out.precision(6);
  out << one.unit.model << ',' << one.unit.pressure_kpa << ',' << one.unit.path << ',' << one.ring << ','
      << one.is_cell << ',' << one.depth_mm << ',' << one.is_limited << ',' << one.true_n << ','
      << one.has_forces << ',' << one.is_ok << ',' << one.found_n << ',' << one.force_error_n << ','
      << one.center_error_mm << ',' << one.phantom_n << ',' << one.balance_n << ',' << one.reasons << '\n';
  return out.str();
}

Result<std::vector<SweepContact>> ParseSweepCsv(const std::string& text) {
  std::vector<SweepContact> out;
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  const auto wrong = [&](size_t number) {
    return Error{ErrorCode::kInvalidArgument, "line " + std::to_string(number) + " is not of a sweep"};
  };
  if (!line.empty() && line + "\n" != SweepCsvHeader()) return wrong(1);
  for (size_t number = 2; std::getline(lines, line); ++number) {
    if (lines.eof()) break;
    std::vector<std::string> cells;
    std::istringstream parts(line + ",");
    for (std::string cell; std::getline(parts, cell, ',');) cells.push_back(cell);
    if (cells.size() != kColumns) return wrong(number);
    try {
      out.push_back(
          {.unit = {.model = cells[0], .pressure_kpa = std::stod(cells[1]), .path = std::stoi(cells[2])},
           .ring = std::stoi(cells[3]),
           .is_cell = cells[4] == "1",
           .depth_mm = std::stod(cells[5]),
           .is_limited = cells[6] == "1",
           .true_n = std::stod(cells[7]),
           .has_forces = cells[8] == "1",
           .is_ok = cells[9] == "1",
           .found_n = std::stod(cells[10]),
           .force_error_n = std::stod(cells[11]),
           .center_error_mm = std::stod(cells[12]),
           .phantom_n = std::stod(cells[13]),
           .balance_n = std::stod(cells[14]),
           .reasons = cells[15]});
    } catch (const std::exception&) {
      return wrong(number);
    }
  }
  return out;
}

std::vector<SweepContact> WholeUnits(const std::vector<LinkModel>& models,
                                     std::vector<SweepContact> contacts) {
  std::map<SweepUnit, size_t> counts;
  for (const SweepContact& one : contacts) ++counts[one.unit];
  std::erase_if(contacts, [&](const SweepContact& one) {
    const auto model = std::ranges::find(models, one.unit.model, &LinkModel::name);
    return model != models.end() && counts[one.unit] < SweepContactsOfUnit(*model);
  });
  return contacts;
}

std::set<SweepUnit> UnitsOf(std::span<const SweepContact> contacts) {
  std::set<SweepUnit> units;
  for (const SweepContact& one : contacts) units.insert(one.unit);
  return units;
}

}  // namespace taclink
