#include "client/command/offline/material_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink::command {
namespace {

constexpr double kTellsApart = 1.1;  // ratio of misfits
constexpr double kKpaPerMpa = 1e3;
constexpr double kContradiction = 3;  // standard deviations

void PrintKind(const char* name, const std::optional<KindFit>& kind) {
  if (!kind) return;
  fmt::print("  {:<10} alone {:.5g} \u00b1 {:.2g} MPa, {} values; residuals {:.1f} %\n", name,
             kind->youngs_modulus_mpa, kind->sigma_mpa, kind->values, 100 * kind->misfit);
}

void PrintFit(const MaterialFit& fit) {
  fmt::print("{}\n  Young's modulus  {:.5g} \u00b1 {:.2g} MPa (Poisson's ratio {:g})\n",
             Name(fit.material.law), fit.material.youngs_modulus_mpa, fit.sigma_mpa,
             fit.material.poisson_ratio);
  PrintKind("inflation", fit.inflation);
  PrintKind("forces", fit.probe);
  if (std::abs(fit.tension) > kContradiction)
    fmt::print("  the two contradict each other by {:.1f} standard deviations\n", std::abs(fit.tension));
}

Json KindJson(const std::optional<KindFit>& kind) {
  if (!kind) return nullptr;
  return {{"youngs_modulus_mpa", kind->youngs_modulus_mpa},
          {"standard_deviation_mpa", kind->sigma_mpa},
          {"values", kind->values},
          {"chi2", kind->chi2},
          {"misfit", kind->misfit}};
}

Json FitJson(const MaterialFit& fit) {
  Json inflations = Json::array(), probes = Json::array();
  for (const InflationFit& one : fit.inflations) {
    inflations.push_back({{"name", one.name},
                          {"pressure_kpa", one.pressure_mpa * kKpaPerMpa},
                          {"used", one.used},
                          {"outliers", one.outliers},
                          {"measured_mm", one.measured_mm},
                          {"rmse_mm", one.rmse_mm},
                          {"youngs_modulus_mpa", one.youngs_modulus_mpa},
                          {"standard_deviation_mpa", one.sigma_mpa}});
  }
  for (const ProbeFit& one : fit.probes) {
    probes.push_back(
        {{"name", one.name}, {"used", one.used}, {"measured_n", one.measured_n}, {"model_n", one.model_n}});
  }
  return {{"law", Name(fit.material.law)},
          {"youngs_modulus_mpa", fit.material.youngs_modulus_mpa},
          {"standard_deviation_mpa", fit.sigma_mpa},
          {"poisson_ratio", fit.material.poisson_ratio},
          {"misfit", fit.misfit},
          {"inflation", KindJson(fit.inflation)},
          {"forces", KindJson(fit.probe)},
          {"tension", fit.tension},
          {"inflation_records", inflations},
          {"probe_rows", probes}};
}

}  // namespace

MaterialChoice ChooseLaw(std::vector<MaterialFit> fits, std::vector<MaterialChoice::Refusal> refusals,
                         MaterialLaw model_law) {
  MaterialChoice choice{.fits = std::move(fits), .refusals = std::move(refusals)};
  const auto& all = choice.fits;
  for (size_t i = 1; i < all.size(); ++i) {
    if (all[i].misfit < all[choice.chosen].misfit) choice.chosen = i;
  }
  choice.decided = all.size() > 1;
  const double least = all[choice.chosen].misfit;
  for (size_t i = 0; i < all.size(); ++i) {
    if (i != choice.chosen && all[i].misfit < kTellsApart * least) choice.decided = false;
  }
  if (choice.decided) return choice;
  const auto own = std::find_if(all.begin(), all.end(),
                                [&](const MaterialFit& fit) { return fit.material.law == model_law; });
  if (own != all.end()) choice.chosen = static_cast<size_t>(own - all.begin());
  return choice;
}

MaterialEvidence EvidenceOf(const MaterialFit& fit) {
  std::string source;
  for (const InflationFit& one : fit.inflations)
    source += fmt::format("{}{:g}", source.empty() ? "inflation at " : ", ", one.pressure_mpa * kKpaPerMpa);
  if (fit.inflation) source += fmt::format(" kPa, residuals {:.1f} %", 100 * fit.inflation->misfit);
  if (fit.probe) {
    source += fmt::format("{}{} probe forces, residuals {:.1f} %", source.empty() ? "" : "; ",
                          fit.probes.size(), 100 * fit.probe->misfit);
  }
  return {fit.sigma_mpa, source};
}

void PrintMaterialText(const LinkModel& model, const MaterialChoice& choice) {
  for (const MaterialFit& fit : choice.fits) PrintFit(fit);
  for (const auto& [law, why] : choice.refusals) fmt::print("{}\n  refused: {}\n", Name(law), why.message);
  const MaterialFit& fit = choice.fit();
  if (choice.decided) {
    fmt::print("\n{} explains the records better\n", Name(fit.material.law));
  } else if (choice.fits.size() > 1) {
    fmt::print("\nThe records don't tell the laws apart; {} is kept\n", Name(fit.material.law));
  }
  fmt::print("\n{}, with {} and {:.5g} MPa:\n", model.name, Name(fit.material.law),
             fit.material.youngs_modulus_mpa);
  if (!fit.inflations.empty())
    fmt::print("    kPa  markers  left out  moved mm  residual mm  modulus alone, MPa\n");
  for (const InflationFit& one : fit.inflations) {
    fmt::print("{:7.3f}  {:7d}  {:8d}  {:8.3f}  {:11.3f}  ", one.pressure_mpa * kKpaPerMpa, one.used,
               one.outliers, one.measured_mm, one.rmse_mm);
    fmt::print("{}\n", one.sigma_mpa > 0
                           ? fmt::format("{:.5g} \u00b1 {:.2g}", one.youngs_modulus_mpa, one.sigma_mpa)
                           : "-");
  }
  if (!fit.probes.empty()) fmt::print("measured N  model N  row\n");
  for (const ProbeFit& one : fit.probes) {
    fmt::print("{:10.3f}  {:7.3f}  {}{}\n", one.measured_n, one.model_n, one.name,
               one.used ? "" : ", left out");
  }
}

void PrintMaterialJson(const LinkModel& model, const MaterialChoice& choice) {
  Json laws = Json::array(), refusals = Json::array();
  for (const MaterialFit& fit : choice.fits) laws.push_back(FitJson(fit));
  for (const auto& [law, why] : choice.refusals)
    refusals.push_back({{"law", Name(law)}, {"reason", why.message}});
  const MaterialFit& fit = choice.fit();
  const Json out = {{"model", model.name},
                    {"law", Name(fit.material.law)},
                    {"law_decided", choice.decided},
                    {"youngs_modulus_mpa", fit.material.youngs_modulus_mpa},
                    {"standard_deviation_mpa", fit.sigma_mpa},
                    {"laws", laws},
                    {"refused", refusals}};
  std::puts(out.dump().c_str());
}

}  // namespace taclink::command
