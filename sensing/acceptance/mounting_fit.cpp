#include "sensing/acceptance/mounting_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

namespace taclink {
namespace {

constexpr size_t kLeastPlaces = 4;  // two equations each, six unknowns
// A component with a larger half-width is undetermined: places on one line leave the rotation about it free.
constexpr double kMostWidthRad = 0.5, kMostWidthMm = 50;

struct PlaceSum {
  Vec3 reference_mm = Vec3::Zero(), measured_mm = Vec3::Zero();
  int pairs = 0;
};

Mat3 CrossMatrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

std::optional<MountingFit> FitMounting(const std::vector<PlacePair>& pairs) {
  std::map<int, PlaceSum> places;
  for (const PlacePair& pair : pairs) {
    PlaceSum& sum = places[pair.place];
    sum.reference_mm += pair.reference_mm;
    sum.measured_mm += pair.measured_mm;
    ++sum.pairs;
  }
  if (places.size() < kLeastPlaces) return std::nullopt;
  Vec3 center = Vec3::Zero();
  for (auto& [place, sum] : places) {
    sum.reference_mm /= sum.pairs;
    sum.measured_mm /= sum.pairs;
    center += sum.reference_mm / static_cast<double>(places.size());
  }
  const auto rows = static_cast<Eigen::Index>(2 * places.size());
  Eigen::MatrixXd a(rows, 6);
  Eigen::VectorXd b(rows);
  Eigen::Index row = 0;
  for (const auto& [place, sum] : places) {
    const Vec3 radial(sum.reference_mm.x(), sum.reference_mm.y(), 0);
    if (!(radial.norm() > 0)) return std::nullopt;
    Eigen::Matrix<double, 2, 3> tangents;
    tangents << Vec3::UnitZ().cross(radial.normalized()).transpose(), Vec3::UnitZ().transpose();
    a.block<2, 3>(row, 0) = -tangents * CrossMatrix(sum.reference_mm - center);  // omega x r
    a.block<2, 3>(row, 3) = tangents;
    b.segment<2>(row) = tangents * (sum.measured_mm - sum.reference_mm);
    row += 2;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::VectorXd solution = svd.solve(b);
  const double freedom = static_cast<double>(rows) - 6;
  // Errors around the axis and along it have different variances, hence the heteroscedasticity-consistent
  // covariance HC3 (MacKinnon and White, 1985): residuals are divided by 1 - leverage.
  const Eigen::VectorXd inverse = (svd.singularValues().array().max(1e-9)).inverse();
  const Eigen::MatrixXd solve = svd.matrixV() * inverse.asDiagonal() * svd.matrixU().transpose();
  const Eigen::ArrayXd leverage = svd.matrixU().rowwise().squaredNorm().array().min(0.99);
  const Eigen::ArrayXd errors = (b - a * solution).array() / (1 - leverage);
  MountingFit fit;
  for (int i = 0; i < 6; ++i) {
    Estimate& estimate =
        i < 3 ? fit.rotation_rad[static_cast<size_t>(i)] : fit.shift_mm[static_cast<size_t>(i - 3)];
    estimate.value = solution[i];
    estimate.samples = static_cast<int>(places.size());
    const double width = StudentT95(freedom) * (solve.row(i).transpose().array() * errors).matrix().norm();
    if (width < (i < 3 ? kMostWidthRad : kMostWidthMm)) estimate.half_width = width;
  }
  return fit;
}

}  // namespace taclink
