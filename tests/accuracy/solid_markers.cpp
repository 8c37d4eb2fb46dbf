#include "tests/accuracy/solid_markers.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace taclink {
namespace {

constexpr double kPressureSigmaMpa = 5e-5;

unsigned SeedOf(const SolidScene& scene, const MarkerCondition& condition) {
  unsigned seed = 2166136261u;  // FNV-1a: the same everywhere, unlike std::hash
  for (const char c : scene.name + condition.name) seed = (seed ^ static_cast<unsigned char>(c)) * 16777619u;
  return seed;
}

// Of the markers, as published: relative to the baseline.
void AddShapeErrors(const SolidScene& scene, const SkinShape& shape, AccuracyRow& row) {
  double sum = 0;
  for (size_t m = 0; m < scene.markers_mm.size(); ++m) {
    const double off = (shape.displacements_mm[m] - (scene.markers_mm[m] - scene.baseline_mm[m])).norm();
    sum += off * off;
    row.shape_worst_mm = std::max(row.shape_worst_mm, off);
  }
  row.shape_rms_mm = std::sqrt(sum / static_cast<double>(scene.markers_mm.size()));
}

void SetSpecificForce(const Vec3& mps2, bool is_measured, MeasuredLoads& loads) {
  constexpr double kGravity = 9.80665, kSigmaMps2 = 0.2;
  if (is_measured) loads.specific_force_mps2 = mps2;
  const double variance = is_measured ? kSigmaMps2 * kSigmaMps2 : kGravity * kGravity / 3;
  loads.specific_force_covariance = variance * Mat3::Identity();
}

}  // namespace

MarkerInput MakeMarkerInput(const SolidScene& scene, const MarkerCondition& condition) {
  std::mt19937 random(SeedOf(scene, condition));
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> lot(0, 1);
  const double sigma_mm = std::max(condition.noise_mm, 0.02);
  MarkerInput input;
  for (size_t m = 0; m < scene.markers_mm.size(); ++m) {
    Vec3 at = scene.markers_mm[m] - scene.baseline_mm[m];
    for (int c = 0; c < 3; ++c) at[c] += condition.noise_mm * normal(random);
    const bool seen = lot(random) >= condition.missing;
    input.shape.measured.push_back(seen ? MeasuredDisplacement{at, Mat3::Identity() / (sigma_mm * sigma_mm)}
                                        : MeasuredDisplacement{});
    input.shape.sources.push_back(seen ? MarkerSource::kBoth : MarkerSource::kInferred);
  }
  for (int i = 0; i < condition.wrong; ++i) {
    const auto m = static_cast<size_t>(lot(random) * static_cast<double>(scene.markers_mm.size()));
    const Vec3 way = Vec3(normal(random), normal(random), normal(random)).normalized();
    input.shape.measured[m].displacement_mm += 10 * lot(random) * way;
  }
  input.loads.now = {scene.pressure_kpa * 1e-3 + condition.pressure_error_pa * 1e-6, kPressureSigmaMpa};
  input.loads.baseline = {scene.baseline_kpa * 1e-3, scene.baseline_kpa > 0 ? kPressureSigmaMpa : 0};
  if (!scene.specific_force_mps2.isZero()) {
    SetSpecificForce(scene.specific_force_mps2, condition.attitude == AttitudeMeasured::kAlways,
                     input.loads.now);
    SetSpecificForce(scene.baseline_specific_force_mps2, condition.attitude != AttitudeMeasured::kNever,
                     input.loads.baseline);
  }
  return input;
}

AccuracyRow SolveSolidMarkers(const SolidScene& scene, const MarkerCondition& condition,
                              StateEstimator& estimator) {
  const LinkModel model = SolidSkin();
  const MarkerInput input = MakeMarkerInput(scene, condition);
  const LinkState state = SolveMarkers(model, estimator, input.loads, input.shape);
  AccuracyRow row = MakeRow(condition.name, scene, state);
  if (row.is_ok) AddShapeErrors(scene, state.shape, row);
  return row;
}

}  // namespace taclink
