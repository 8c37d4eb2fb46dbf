#include "bench/stability/stability_cases.h"

#include <cmath>
#include <cstdio>

#include "sensing/core/known_loads.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr MaterialLaw kBothLaws[] = {MaterialLaw::kSaintVenantKirchhoff, MaterialLaw::kNeoHookean};

constexpr double kToTubeMm = 21.55;  // pressed against it

const Vec3 kLying(0, -kStandardGravity, 0),
    kTilted = std::sqrt(0.5) * Vec3(0, -kStandardGravity, -kStandardGravity),
    kUpsideDown(0, 0, kStandardGravity);

const char* ShortName(MaterialLaw law) {
  return law == MaterialLaw::kNeoHookean ? "NH" : "SVK";
}

double MidRadius(const LinkModel& model) {
  return model.PointAtDepth(0, model.length_mm / 2, model.thickness_mm / 2).x();
}

double PoissonOf(MaterialLaw law) {
  return law == MaterialLaw::kNeoHookean ? 0.5 : 0.49;
}

std::string Label(const char* format, double value, MaterialLaw law) {
  char text[96];
  std::snprintf(text, sizeof text, format, value);  // NOLINT(clang-diagnostic-format-nonliteral)
  return std::string(text) + ", " + ShortName(law);
}

class Cases {
 public:
  explicit Cases(const LinkModel& base) : base_(base) {}

  void Add(const std::string& name, const LinkModel& model, double kpa, double depth_mm,
           double reference = 0) {
    char load[64];
    std::snprintf(load, sizeof load, ", %g kPa, dent %g mm", kpa, depth_mm);
    cases.push_back({.name = name + load,
                     .model = model,
                     .pressure_mpa = ScaledPressureMpa(base_, model, kpa),
                     .depth_mm = depth_mm,
                     .reference_modulus_mpa = reference});
  }
  void AddHeld(const std::string& name, const LinkModel& model, double kpa, double depth_mm,
               const Vec3& specific_force_mps2, double reference = 0) {
    Add(name, model, kpa, depth_mm, reference);
    cases.back().specific_force_mps2 = specific_force_mps2;
  }
  LinkModel Varied(double modulus, double thickness_by_radius, MaterialLaw law) const {
    return VariedModel(base_, modulus, thickness_by_radius, PoissonOf(law), law);
  }

  std::vector<SkinCase> cases;

 private:
  const LinkModel& base_;
};

void AddMaterials(Cases& to, const LinkModel& base, double slenderness) {
  for (const MaterialLaw law : kBothLaws) {
    for (const double modulus : {1e-4, 1e-2, 1.0, 1e2, 1e5})
      to.Add(Label("E = %g MPa", modulus, law), to.Varied(modulus, slenderness, law), 1.5, 8, 0.1);
  }
  for (const double poisson : {0.0, 0.3, 0.49, 0.4999, 0.5}) {
    const auto law = MaterialLaw::kSaintVenantKirchhoff;
    to.Add(Label("nu = %g", poisson, law), VariedModel(base, 0.1, slenderness, poisson, law), 1, 8);
  }
}

void AddShapesAndLoads(Cases& to, double slenderness) {
  for (const MaterialLaw law : kBothLaws) {
    for (const double ratio : {1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2}) {
      to.Add(Label("t/R = %g", ratio, law), to.Varied(0.1, ratio, law), 1, 0);
      to.Add(Label("t/R = %g", ratio, law), to.Varied(0.1, ratio, law), 1, 5);
    }
    const LinkModel shipped = to.Varied(0.1, slenderness, law);
    for (const double kpa : {-0.5, -0.25, 0.5, 1.5, 2.5}) {
      to.Add(Label("t/R = %g", slenderness, law), shipped, kpa, 0);
      to.Add(Label("t/R = %g", slenderness, law), shipped, kpa, 8);
    }
    for (const double kpa : {0.0, 1.0})
      to.Add(Label("to the tube, t/R = %g", slenderness, law), shipped, kpa, kToTubeMm);
  }
  const MaterialLaw law = MaterialLaw::kSaintVenantKirchhoff;
  to.Add(Label("E = 1e5 MPa and t/R = %g", 1e-3, law), to.Varied(1e5, 1e-3, law), 1, 1, 0.1);
  to.Add(Label("E = 1e-4 MPa and t/R = %g", 0.2, law), to.Varied(1e-4, 0.2, law), 1, 5, 0.1);
}

void AddHeldSkins(Cases& to, double slenderness) {
  constexpr double kUsual = 0.1, kSoft = 0.02;
  for (const MaterialLaw law : kBothLaws) {
    const LinkModel shipped = to.Varied(kUsual, slenderness, law), soft = to.Varied(kSoft, slenderness, law);
    to.AddHeld(Label("lying, E = %g MPa", kUsual, law), shipped, 0, 0, kLying);
    to.AddHeld(Label("lying, E = %g MPa", kUsual, law), shipped, 1, 5, kLying);
    to.AddHeld(Label("lying at 2 g, E = %g MPa", kUsual, law), shipped, 0.5, 0, 2 * kLying);
    to.AddHeld(Label("upside down, E = %g MPa", kUsual, law), shipped, 0, 5, kUpsideDown);
    to.AddHeld(Label("lying, E = %g MPa", kSoft, law), soft, 1, 5, kLying, kUsual);
  }
}

void AddLive(const LinkModel& base, const std::string& name, const LinkModel& model, double kpa,
             std::vector<SkinCase>& cases) {
  constexpr double kSigmaKpa = 0.02;
  char load[48];
  std::snprintf(load, sizeof load, ", %g kPa", kpa);
  cases.push_back({.name = name + load,
                   .model = model,
                   .pressure_mpa = ScaledPressureMpa(base, model, kpa),
                   .pressure_sigma_mpa = ScaledPressureMpa(base, model, kSigmaKpa)});
}

void AddShipped(const LinkModel& base, std::vector<SkinCase>& cases) {
  for (const std::string& name : ShippedModelNames()) {
    const auto model = LoadLinkModel(name);
    if (!model) continue;
    for (const double kpa : {0.0, 0.5, 1.5}) AddLive(base, name, *model, kpa, cases);
  }
}

void AddHeldLive(const LinkModel& base, std::vector<SkinCase>& cases) {
  constexpr double kSoft = 0.02;
  const auto add = [&](const std::string& name, const LinkModel& model, double kpa,
                       const Vec3& specific_force_mps2) {
    AddLive(base, name, model, kpa, cases);
    cases.back().specific_force_mps2 = specific_force_mps2;
  };
  for (const std::string& name : ShippedModelNames()) {
    const auto model = LoadLinkModel(name);
    if (model) add(name + " lying", *model, 0.5, kLying);
  }
  add(base.name + " lying", base, 0, kLying);
  add(base.name + " upside down", base, 0, kUpsideDown);
  add(base.name + " tilted", base, 1, kTilted);
  add(base.name + " lying at 2 g", base, 0.5, 2 * kLying);
  const auto law = MaterialLaw::kNeoHookean;
  const LinkModel soft = VariedModel(base, kSoft, base.thickness_mm / MidRadius(base), PoissonOf(law), law);
  add(Label("lying, E = %g MPa", kSoft, law), soft, 1, kLying);
}

}  // namespace

const char* Name(Ending ending) {
  switch (ending) {
    case Ending::kRight:
      return "right";
    case Ending::kRefused:
      return "refused";
    case Ending::kWrong:
      return "WRONG";
  }
  return "unknown";
}

LinkModel VariedModel(const LinkModel& base, double modulus_mpa, double thickness_by_radius, double poisson,
                      MaterialLaw law) {
  LinkModel model = base;
  const double radius = MidRadius(base);
  const double inside = base.markers.center_depth_mm - base.thickness_mm;
  model.thickness_mm = thickness_by_radius * radius;
  model.profile = RadiusProfile::Constant(radius);
  model.profile_depth_mm = model.thickness_mm / 2;
  model.markers.center_depth_mm = model.thickness_mm + inside;
  model.material = {.youngs_modulus_mpa = modulus_mpa, .poisson_ratio = poisson, .law = law};
  return model;
}

double ScaledPressureMpa(const LinkModel& base, const LinkModel& model, double pressure_kpa) {
  constexpr double kShippedModulus = 0.1;
  return 1e-3 * pressure_kpa * model.material.youngs_modulus_mpa / kShippedModulus * model.thickness_mm /
         base.thickness_mm * MidRadius(base) / MidRadius(model);
}

std::vector<SkinCase> SkinCases(const LinkModel& base) {
  Cases cases(base);
  const double slenderness = base.thickness_mm / MidRadius(base);
  AddMaterials(cases, base, slenderness);
  AddShapesAndLoads(cases, slenderness);
  AddHeldSkins(cases, slenderness);
  return std::move(cases.cases);
}

std::vector<SkinCase> LiveCases(const LinkModel& base) {
  std::vector<SkinCase> cases;
  AddShipped(base, cases);
  const double slenderness = base.thickness_mm / MidRadius(base);
  for (const MaterialLaw law : kBothLaws) {
    const auto add = [&](const std::string& name, double modulus, double ratio, double kpa) {
      AddLive(base, name, VariedModel(base, modulus, ratio, PoissonOf(law), law), kpa, cases);
    };
    for (const double modulus : {1e-4, 0.02, 1.0, 1e2})
      add(Label("E = %g MPa", modulus, law), modulus, slenderness, 1);
    for (const double ratio : {0.01, 0.03, 0.2}) add(Label("t/R = %g", ratio, law), 0.1, ratio, 1);
    for (const double kpa : {-0.2, -0.1, 2.5})
      add(Label("t/R = %g", slenderness, law), 0.1, slenderness, kpa);
  }
  for (const double poisson : {0.0, 0.3}) {
    const auto law = MaterialLaw::kSaintVenantKirchhoff;
    AddLive(base, Label("nu = %g", poisson, law), VariedModel(base, 0.1, slenderness, poisson, law), 1,
            cases);
  }
  AddHeldLive(base, cases);
  return cases;
}

std::string ReasonsOf(const LinkState& state) {
  std::string reasons;
  for (const Reason& reason : state.reasons)
    reasons += std::string(reasons.empty() ? "" : ", ") + Name(reason.id);
  return reasons;
}

std::vector<SkinCase> PictureCases(const LinkModel& base) {
  std::vector<SkinCase> cases;
  AddShipped(base, cases);
  const double slenderness = base.thickness_mm / MidRadius(base);
  const auto law = MaterialLaw::kNeoHookean;
  for (const double modulus : {0.02, 1.0})
    AddLive(base, Label("E = %g MPa", modulus, law),
            VariedModel(base, modulus, slenderness, PoissonOf(law), law), 1, cases);
  return cases;
}

}  // namespace taclink
