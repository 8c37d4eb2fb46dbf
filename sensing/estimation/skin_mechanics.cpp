#include "sensing/estimation/skin_mechanics.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/estimation/untouched_skins.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {
namespace {

// Elements must follow a dent, which decays over sqrt(R t): 0.8 of it along the axis; around, 15 degrees.
constexpr double kLongestElement = 0.8, kWidestElementDeg = 15;
// Standard deviation of a load's spread. Narrower, dents that no camera sees come out up to a fifth too deep,
// on these elements; wider, forces of bodies smaller than 5 mm do.
constexpr double kLoadSpreadMm = 3.8;
constexpr double kLeastShare = 0.02;      // of the largest; less is left out of a spread
constexpr double kInflationStep = 0.011;  // of PressureScale

MeshRefinement RefinementFor(const LinkModel& model) {
  const double longest = kLongestElement * DecayLengthMm(model);
  double widest_interval = model.markers.rings_z_mm.front();
  for (size_t i = 1; i < model.markers.rings_z_mm.size(); ++i)
    widest_interval =
        std::max(widest_interval, model.markers.rings_z_mm[i] - model.markers.rings_z_mm[i - 1]);
  widest_interval = std::max(widest_interval, model.length_mm - model.markers.rings_z_mm.back());
  const auto parts = [](double share) { return std::max(1, static_cast<int>(std::ceil(share - 1e-9))); };
  return {parts(DegFromRad(model.markers.path_pitch_rad()) / kWidestElementDeg),
          parts(widest_interval / longest)};
}

}  // namespace

SkinMechanics::SkinMechanics(const LinkModel& model, int refinement)
    : model_(model),
      mesh_(refinement > 0 ? MakeShellMesh(model, refinement) : MakeShellMesh(model, RefinementFor(model))),
      shell_(SkinSurface(mesh_), model.material),
      markers_(model, mesh_),
      length_unit_(LengthUnit(model)),
      force_unit_(ForceUnit(model)),
      pressure_step_mpa_(kInflationStep * PressureScale(model)) {
  MakeSpread();
  SetUpWeight();
  untouched_ = std::make_unique<UntouchedSkins>(*this);
}

SkinMechanics::~SkinMechanics() = default;

bool SkinMechanics::IsBeyondMarkers(int site) const {
  const double z = RestSite(site).z();
  const auto& rings = model_.markers.rings_z_mm;
  const double margin = 0.12 * (rings[1] - rings[0]);
  return z < rings.front() + margin || z > rings.back() - margin;
}

double SkinMechanics::DistanceToClamp(int site) const {
  const double z = RestSite(site).z();
  return std::min(z, model_.length_mm - z);
}

void SkinMechanics::MakeSpread() {
  const double width = kLoadSpreadMm * length_unit_;
  std::vector<Eigen::Triplet<double>> entries;
  for (int to = 0; to < site_count(); ++to) {
    double sum = 0, largest = 0;
    std::vector<std::pair<int, double>> shares;
    for (int site = 0; site < site_count(); ++site) {
      const double off2 = (RestSite(site) - RestSite(to)).squaredNorm();
      if (off2 > 25 * width * width) continue;
      const double share =
          std::exp(-off2 / (2 * width * width)) * mesh_.areas_mm2[static_cast<size_t>(NodeOfSite(site))];
      shares.emplace_back(site, share);
      largest = std::max(largest, share);
    }
    std::erase_if(shares, [&](const auto& s) { return s.second < kLeastShare * largest; });
    for (const auto& s : shares) sum += s.second;
    for (const auto& [site, share] : shares) entries.emplace_back(site, to, share / sum);
  }
  spread_.resize(site_count(), site_count());
  spread_.setFromTriplets(entries.begin(), entries.end());
  spread_.makeCompressed();
}

// Finds the weight's gradient.
void SkinMechanics::SetUpWeight() {
  gradient_by_specific_force_.setZero(shell_.dof_count(), KnownLoads::kCount);
  mass_per_area_ = model_.MassPerArea();
  if (mass_per_area_ == 0) return;
  corner_areas_mm2_ = CornerAreas(shell_.surface());
  Eigen::VectorXd with, without;
  shell_.Gradient(shell_.Rest(), {}, without);
  for (int axis = 0; axis < 3; ++axis) {
    const BodyForce unit(corner_areas_mm2_, mass_per_area_ * Vec3::Unit(axis));
    const ElementLoad* one[] = {&unit};
    shell_.Gradient(shell_.Rest(), one, with);
    gradient_by_specific_force_.col(1 + axis) = with - without;
  }
}

// The weight is a dead load of the nodes.
double SkinMechanics::Gradient(const ShellState& state, const KnownLoads& loads,
                               Eigen::VectorXd& gradient) const {
  const PressureLoads pressure(loads.pressure_mpa);
  double energy_nmm = shell_.Gradient(state, pressure.loads(), gradient);
  const Eigen::VectorXd weight = Weight(loads);
  if (weight.size() == 0) return energy_nmm;
  gradient -= weight;
  for (int site = 0; site < site_count(); ++site) {
    const auto node = static_cast<size_t>(NodeOfSite(site));
    energy_nmm -=
        weight.segment<3>(shell_.Dof(NodeOfSite(site), 0)).dot(state.mids_mm[node] - mesh_.mid_mm[node]);
  }
  return energy_nmm;
}

void SkinMechanics::GradientByLoads(const ShellState& state, ByKnownLoads& out) const {
  const FollowerPressure unit(1);
  const ElementLoad* one[] = {&unit};
  Eigen::VectorXd with, without;
  shell_.Gradient(state, one, with);
  shell_.Gradient(state, {}, without);
  out = gradient_by_specific_force_;
  out.col(0) = with - without;
}

Eigen::VectorXd SkinMechanics::Weight(const KnownLoads& loads) const {
  if (mass_per_area_ == 0 || loads.specific_force_mps2.isZero(0)) return {};
  return -gradient_by_specific_force_.rightCols<3>() * loads.specific_force_mps2;
}

const UntouchedSkin* SkinMechanics::Untouched(const KnownLoads& loads) {
  return untouched_->Find(loads);
}

AppliedLoads::AppliedLoads(const SkinMechanics& mechanics, const KnownLoads& loads)
    : pressure_(loads.pressure_mpa),
      body_(mechanics.corner_areas_mm2(), mechanics.mass_per_area() * loads.specific_force_mps2) {
  if (loads.pressure_mpa != 0) all_[count_++] = &pressure_;
  if (mechanics.mass_per_area() > 0 && !loads.specific_force_mps2.isZero(0)) all_[count_++] = &body_;
}

}  // namespace taclink
