#include "sensing/camera/lens.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr int kMaxNewtonSteps = 30;
constexpr int kLimitSteps = 256;
constexpr double kPrecision = 1e-7;  // of a Newton step; what is left after it is its square

// A zero of a rising function within [low, high]: Newton, guarded by bisection. `at` returns value and slope.
template <typename Function>
double Solve(Function at, double start, double low, double high, double precision) {
  double x = start;
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const auto [value, slope] = at(x);
    (value > 0 ? high : low) = x;
    double next = x - value / slope;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double step = std::abs(next - x);
    x = next;
    if (step <= precision) break;
  }
  return x;
}

}  // namespace

LensParameters ParametersOf(const LensModel& lens) {
  LensParameters p = LensParameters::Zero();
  p[0] = lens.focal_px;
  if (lens.kind == LensKind::kDivision) {
    p[1] = lens.k1_per_px2;
    p[2] = lens.k2_per_px4;
  } else {
    std::copy(lens.fisheye_k.begin(), lens.fisheye_k.end(), p.data() + 1);
  }
  return p;
}

void SetParameters(const LensParameters& parameters, LensModel& lens) {
  lens.focal_px = parameters[0];
  if (lens.kind == LensKind::kDivision) {
    lens.k1_per_px2 = parameters[1];
    lens.k2_per_px4 = parameters[2];
  } else {
    std::copy(parameters.data() + 1, parameters.data() + kMaxLensParameters, lens.fisheye_k.begin());
  }
}

Lens::Lens(const LensModel& model, double limit_px) : model_(model) {
  if (model.kind == LensKind::kDivision) {
    LimitDivision(limit_px);
  } else {
    LimitFisheye(limit_px);
  }
  max_sine_ = std::sin(max_theta_rad_);
  max_cosine_ = std::cos(max_theta_rad_);
}

void Lens::LimitDivision(double limit_px) {
  for (int i = 1; i <= kLimitSteps; ++i) {
    const double r = limit_px * i / kLimitSteps;
    if (Depth(r) - r * DepthSlope(r) <= 0) break;  // the sign of dtheta/dr
    max_radius_px_ = r;
  }
  max_theta_rad_ = std::atan2(max_radius_px_, Depth(max_radius_px_));
}

void Lens::LimitFisheye(double limit_px) {
  for (int i = 1; i <= kLimitSteps; ++i) {
    const double theta = kPi * i / kLimitSteps;
    if (ThetaDSlope(theta) <= 0) break;
    max_theta_rad_ = theta;
    max_radius_px_ = model_.focal_px * ThetaD(theta);
    if (max_radius_px_ > limit_px) break;
  }
}

double Lens::ThetaD(double theta) const {
  const double t = theta * theta;
  const auto& k = model_.fisheye_k;
  return theta * (1 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3]))));
}

double Lens::ThetaDSlope(double theta) const {
  const double t = theta * theta;
  const auto& k = model_.fisheye_k;
  return 1 + t * (3 * k[0] + t * (5 * k[1] + t * (7 * k[2] + t * 9 * k[3])));
}

// r cos(theta) = sin(theta) Depth(r): a polynomial, so that no step needs an angle.
Lens::Radius Lens::DivisionRadius(double sine, double cosine) const {
  const double guess = cosine * max_radius_px_ > sine * model_.focal_px ? model_.focal_px * sine / cosine
                                                                        : 0.9 * max_radius_px_;
  const double r = Solve(
      [&](double at) { return std::pair{at * cosine - sine * Depth(at), cosine - sine * DepthSlope(at)}; },
      std::min(guess, 0.9 * max_radius_px_), 0, max_radius_px_, kPrecision * max_radius_px_);
  const double depth = Depth(r);
  return {r, (r * r + depth * depth) / (depth - r * DepthSlope(r))};
}

std::optional<Lens::Radius> Lens::AtPoint(double across, double along) const {
  const double distance = std::sqrt(across * across + along * along);
  const double sine = across / distance, cosine = along / distance;
  // theta < max_theta, both between 0 and pi.
  if (!(sine * max_cosine_ < cosine * max_sine_)) return std::nullopt;
  if (model_.kind == LensKind::kDivision) return DivisionRadius(sine, cosine);
  const double theta = std::atan2(across, along);
  return Radius{model_.focal_px * ThetaD(theta), model_.focal_px * ThetaDSlope(theta)};
}

std::optional<Lens::Radius> Lens::AtAngle(double theta_rad) const {
  if (!(theta_rad >= 0 && theta_rad < max_theta_rad_)) return std::nullopt;
  return AtPoint(std::sin(theta_rad), std::cos(theta_rad));
}

std::optional<double> Lens::AngleAt(double radius_px) const {
  if (!(radius_px >= 0 && radius_px <= max_radius_px_)) return std::nullopt;
  if (model_.kind == LensKind::kDivision) return std::atan2(radius_px, Depth(radius_px));
  const double theta_d = radius_px / model_.focal_px;
  return Solve([&](double at) { return std::pair{ThetaD(at) - theta_d, ThetaDSlope(at)}; },
               std::min(theta_d, 0.9 * max_theta_rad_), 0, max_theta_rad_, kPrecision);
}

LensParameters Lens::RadiusByParameters(double theta_rad, double radius_px) const {
  LensParameters d = LensParameters::Zero();
  if (model_.kind == LensKind::kDivision) {
    // From r cos(theta) = sin(theta) Depth(r).
    const double r2 = radius_px * radius_px, depth = Depth(radius_px);
    const double scale = radius_px / (depth - radius_px * DepthSlope(radius_px));
    d[0] = scale * depth / model_.focal_px;
    d[1] = scale * model_.focal_px * r2;
    d[2] = scale * model_.focal_px * r2 * r2;
    return d;
  }
  const double t = theta_rad * theta_rad;
  d[0] = ThetaD(theta_rad);
  double power = model_.focal_px * theta_rad;
  for (int i = 1; i < kMaxLensParameters; ++i) d[i] = power *= t;
  return d;
}

LensModel ConvertLens(const LensModel& lens, LensKind kind, double theta_rad) {
  if (lens.kind == kind) return lens;
  constexpr int kSamples = 48;
  const Lens from(lens, 1e4 * lens.focal_px);
  const double widest = std::min(theta_rad, 0.98 * from.max_theta_rad());
  const int count = LensParameterCount(kind) - 1;
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(kSamples, count);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kSamples);
  for (int i = 0; i < kSamples; ++i) {
    const double theta = widest * (i + 1) / kSamples;
    const auto radius = from.AtAngle(theta);
    if (!radius) continue;
    const double r = radius->px;
    if (kind == LensKind::kDivision) {
      // r cos = f sin (1 + k1 r^2 + k2 r^4), k's in units of 1/f^2 and 1/f^4.
      const double u = std::pow(r / lens.focal_px, 2), f_sine = lens.focal_px * std::sin(theta);
      rows.row(i) << f_sine * u, f_sine * u * u;
      right[i] = r * std::cos(theta) - f_sine;
    } else {
      for (int k = 0; k < count; ++k) rows(i, k) = lens.focal_px * std::pow(theta, 2 * k + 3);
      right[i] = r - lens.focal_px * theta;
    }
  }
  const Eigen::VectorXd k = rows.colPivHouseholderQr().solve(right);
  LensModel to;
  to.kind = kind;
  to.focal_px = lens.focal_px;
  to.principal_point_px = lens.principal_point_px;
  if (kind == LensKind::kDivision) {
    to.k1_per_px2 = k[0] / std::pow(lens.focal_px, 2);
    to.k2_per_px4 = k[1] / std::pow(lens.focal_px, 4);
  } else {
    std::copy(k.data(), k.data() + count, to.fisheye_k.begin());
  }
  return to;
}

}  // namespace taclink
