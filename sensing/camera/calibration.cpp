#include "sensing/camera/calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/rest_check.h"
#include "sensing/core/median.h"

namespace taclink {
namespace {

constexpr double kSigmaPerMedian = 1.4826;  // of a normal distribution's absolute values
constexpr double kMisplacedSigmas = 4.5;

constexpr int kLeastMarkers = 8;

Error Refusal(const std::string& what) {
  return {ErrorCode::kInvalidArgument, "calibration refused: " + what};
}

std::string Rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

void Tell(const CalibrationOptions& options, double done, const std::string& step) {
  if (options.progress) options.progress({done, step});
}

CameraFitOptions FitOptions(const LinkModel& model, CameraId id, const CalibrationOptions& options) {
  return {options.tolerance, options.lens.value_or(model.nominal_rig[id].lens.kind), options.domes};
}

Result<CameraFit> FitOne(const RestShape& shape, CameraId id, std::span<const MarkerObservation> rest,
                         const CalibrationOptions& options) {
  const LinkModel& model = shape.model();
  const std::string camera = std::string("the ") + Name(id) + " camera";
  const int usable = CountUsable(rest);
  if (usable < std::max<double>(kLeastMarkers, options.min_seen * model.markers.count())) {
    return Refusal(camera + " sees only " + std::to_string(usable) + " of " +
                   std::to_string(model.markers.count()) +
                   " markers well: check light, focus and that the model is this link's");
  }
  auto fit = FitCamera(shape, id, rest, FitOptions(model, id, options));
  if (!fit) {
    return Refusal("no lens and place of " + camera +
                   " explain its picture: check that the model is this link's, and its nominal cameras");
  }
  return *std::move(fit);
}

// Residuals against the model's places of the markers.
CameraCalibration Judge(const RestShape& shape, const CameraModel& camera, const CameraFit& fit,
                        std::span<const MarkerObservation> rest, const CalibrationOptions& options) {
  CameraCalibration result;
  result.camera = camera;
  result.markers_used = static_cast<int>(fit.samples.size());
  result.outliers = static_cast<int>(fit.outliers.size());
  result.residuals.resize(rest.size());
  const auto mark = [&](int marker, MarkerResidual::Kind kind) {
    result.residuals[static_cast<size_t>(marker)].kind = kind;
  };
  for (const BundleSample& s : fit.samples) mark(s.marker, MarkerResidual::Kind::kUsed);
  for (const int marker : fit.outliers) mark(marker, MarkerResidual::Kind::kOutlier);
  const Projector projector(camera);
  double squares = 0;
  for (size_t i = 0; i < rest.size(); ++i) {
    MarkerResidual& residual = result.residuals[i];
    const auto pixel =
        projector.Project(SeenPoint(shape, static_cast<int>(i), projector.center_in_link(), options.domes));
    if (residual.kind == MarkerResidual::Kind::kUnseen || !pixel) continue;
    residual.seen_px = rest[i].center_px;
    residual.residual_px = rest[i].center_px - *pixel;
    if (residual.kind == MarkerResidual::Kind::kUsed) squares += residual.residual_px.squaredNorm();
  }
  result.rms_px = std::sqrt(squares / (2.0 * std::max(1, result.markers_used)));
  return result;
}

std::string Percent(double more) {
  return Rounded(100 * std::abs(more)) + " % " + (more > 0 ? "more" : "less");
}

// r(theta) against the nominal lens, where it differs most, as far out as the link fills the picture.
double Magnification(const LinkModel& model, CameraId id, const CameraModel& camera) {
  const CameraModel& nominal = model.nominal_rig[id];
  double widest = 0;
  for (const Vec3& p : model.RestMarkers()) {
    const Vec3 seen = nominal.camera_from_link * p;
    widest = std::max(widest, std::atan2(seen.head<2>().norm(), seen.z()));
  }
  const Projector was(nominal), is(camera);
  double worst = 1;
  for (int i = 1; i <= 8; ++i) {
    const auto a = was.lens().AtAngle(widest * i / 8), b = is.lens().AtAngle(widest * i / 8);
    if (a && b && std::abs(b->px / a->px - 1) > std::abs(worst - 1)) worst = b->px / a->px;
  }
  return worst;
}

// What of a camera is furthest off the model's nominal one.
struct Departure {
  double tolerances = 0;
  std::string what;
};

Departure FarthestOff(const LinkModel& model, CameraId id, const CameraModel& camera,
                      const BuildTolerance& tolerance) {
  CameraModel nominal = model.nominal_rig[id];
  nominal.lens.kind = camera.lens.kind;
  const CameraStep step = StepBetween(nominal, camera);
  const auto deg = [](double rad) { return Rounded(std::abs(DegFromRad(rad))) + " deg"; };
  const double place = step.segment<3>(3).cwiseAbs().maxCoeff(), tilt = step.head<2>().cwiseAbs().maxCoeff();
  const double center = step.segment<2>(6).cwiseAbs().maxCoeff();
  std::vector<Departure> all = {
      {place / tolerance.place_mm, "stands " + Rounded(place) + " mm from"},
      {tilt / tolerance.tilt_rad, "is tilted by " + deg(tilt) + " against"},
      {std::abs(step[2]) / tolerance.roll_rad, "is rolled by " + deg(step[2]) + " against"},
      {center / tolerance.principal_point_px,
       "has its principal point " + Rounded(center) + " px from that of"}};
  const double more = Magnification(model, id, camera) - 1;
  all.push_back({std::abs(more) / tolerance.lens, "magnifies by " + Percent(more) + " than"});
  return *std::max_element(all.begin(), all.end(),
                           [](const auto& a, const auto& b) { return a.tolerances < b.tolerances; });
}

Result<void> CheckCamera(const LinkModel& model, CameraId id, const CameraCalibration& one,
                         const CalibrationOptions& options) {
  const std::string camera = std::string("the ") + Name(id) + " camera";
  const int seen = one.markers_used + one.outliers;
  if (one.outliers > options.max_outliers * seen) {
    return Refusal(std::to_string(one.outliers) + " of the " + std::to_string(seen) + " markers that " +
                   camera +
                   " sees do not fit the model: check that it is this link's, and that nothing "
                   "touches the skin");
  }
  if (!(one.rms_px <= options.max_rms_px)) {
    return Refusal(camera + " fits to " + Rounded(one.rms_px) + " px only, " + Rounded(options.max_rms_px) +
                   " px is the limit: check that the model is this link's, or try the other lens model");
  }
  const Departure off = FarthestOff(model, id, one.camera, options.tolerance);
  if (!(off.tolerances <= options.max_departure)) {
    return Refusal(camera + " " + off.what +
                   " the model's nominal one: it is not this link's model, the skin is under pressure, or "
                   "the model's cameras must be corrected");
  }
  return {};
}

// Lenses differ one by one; both off by the same tell that the link is wider, shorter or inflated.
Result<void> CheckBoth(const LinkModel& model, const CalibrationSummary& summary,
                       const CalibrationOptions& options) {
  double more = -1;
  for (const CameraId id : kBothCameras) more += 0.5 * Magnification(model, id, summary.rig[id]);
  if (std::abs(more) <= options.max_departure * options.tolerance.lens / std::sqrt(2.0)) return {};
  return Refusal(
      "both cameras magnify by " + Percent(more) +
      " than the model's nominal ones: radius or ring distances are not this link's, the skin is under "
      "pressure, or the model's cameras must be corrected");
}

CameraStep SigmasOf(const Eigen::MatrixXd& covariance, size_t camera) {
  if (covariance.size() == 0) return CameraStep::Zero();
  const auto first = static_cast<Eigen::Index>(camera) * kCameraParameters;
  return covariance.diagonal().segment<kCameraParameters>(first).cwiseMax(0).cwiseSqrt();
}

// Both together; the covariances grow by the misfit that each camera showed alone.
Result<BundleResult> AdjustBoth(const RestShape& shape, const std::array<CameraFit, kCameraCount>& fits,
                                const CalibrationOptions& options) {
  const LinkModel& model = shape.model();
  BundleOptions bundle{.tolerance = options.tolerance, .modes_mm = shape.errors_mm()};
  bundle.tolerance.marker_mm *= std::max(fits[0].misfit, fits[1].misfit);
  std::vector<BundleCamera> cameras;
  for (const CameraId id : kBothCameras) {
    const CameraFit& fit = fits[Index(id)];
    cameras.push_back({fit.camera, model.nominal_rig[id], fit.samples});
    for (BundleSample& s : cameras.back().samples) s.covariance_px2 *= fit.misfit * fit.misfit;
  }
  BundleResult result = AdjustBundle(cameras, bundle);
  if (!result.converged) return Refusal("the adjustment of both cameras does not converge");
  return result;
}

// Weighted least squares from the model's place, where one step does nearly all.
std::optional<Vec3> Triangulate(const RestShape& shape, int marker, const CalibrationOptions& options,
                                const std::array<Projector, kCameraCount>& projectors,
                                const LabelledMarkers& rest) {
  const Vec3 start = shape.Marker(marker);
  Vec3 at = start;
  for (int step = 0; step < 4; ++step) {
    Mat3 normal = Mat3::Zero();
    Vec3 right = Vec3::Zero();
    for (const CameraId id : kBothCameras) {
      const Projector& projector = projectors[Index(id)];
      const MarkerObservation& one = rest.cameras[Index(id)][static_cast<size_t>(marker)];
      // A dome's look moves with it.
      const Vec3 look = SeenPoint(shape, marker, projector.center_in_link(), options.domes) - start;
      const auto seen = projector.ProjectWithJacobian(at + look);
      if (!seen) return std::nullopt;
      const Mat2 weight = (one.covariance_px2 + 0.01 * Mat2::Identity()).inverse();
      normal += seen->jacobian.transpose() * weight * seen->jacobian;
      right += seen->jacobian.transpose() * weight * (one.center_px - seen->pixel);
    }
    const Vec3 change = normal.ldlt().solve(right);
    if (!change.allFinite()) return std::nullopt;
    at += change;
  }
  return at;
}

void TriangulateShifts(const RestShape& shape, const LabelledMarkers& rest, const CalibrationOptions& options,
                       CalibrationSummary& summary) {
  const std::array projectors = {Projector(summary.rig[CameraId::kTop]),
                                 Projector(summary.rig[CameraId::kBottom])};
  const auto count = static_cast<size_t>(shape.model().markers.count());
  summary.shifts_mm.assign(count, std::nullopt);
  for (size_t i = 0; i < count; ++i) {
    const auto used = [&](CameraId id) {
      return summary.cameras[Index(id)].residuals[i].kind == MarkerResidual::Kind::kUsed;
    };
    if (!used(CameraId::kTop) || !used(CameraId::kBottom)) continue;
    const int marker = static_cast<int>(i);
    if (const auto at = Triangulate(shape, marker, options, projectors, rest))
      summary.shifts_mm[i] = *at - shape.Marker(marker);
  }
}

// A marker that is half hidden, or whose spot touches its neighbor's, fits each camera alone within a pixel,
// but the lines of sight meet elsewhere. The camera that sees it further off is not believed.
void LeaveOutMisplaced(const CalibrationOptions& options, CalibrationSummary& summary) {
  std::vector<double> sizes_mm;
  for (const auto& shift : summary.shifts_mm)
    if (shift) sizes_mm.push_back(shift->norm());
  if (sizes_mm.empty()) return;
  const double sigma_mm = std::max(options.tolerance.marker_mm, kSigmaPerMedian * Median(sizes_mm));
  for (size_t i = 0; i < summary.shifts_mm.size(); ++i) {
    if (!summary.shifts_mm[i] || summary.shifts_mm[i]->norm() <= kMisplacedSigmas * sigma_mm) continue;
    summary.shifts_mm[i].reset();
    auto& [top, bottom] = summary.cameras;
    CameraCalibration& wrong =
        top.residuals[i].residual_px.norm() > bottom.residuals[i].residual_px.norm() ? top : bottom;
    wrong.residuals[i].kind = MarkerResidual::Kind::kOutlier;
    --wrong.markers_used;
    ++wrong.outliers;
  }
}

void MeasureShifts(const RestShape& shape, const LabelledMarkers& rest, const CalibrationOptions& options,
                   CalibrationSummary& summary) {
  TriangulateShifts(shape, rest, options, summary);
  LeaveOutMisplaced(options, summary);
  double r = 0, phi = 0, z = 0, all = 0;
  for (size_t i = 0; i < summary.shifts_mm.size(); ++i) {
    if (!summary.shifts_mm[i]) continue;
    const Vec3 truth = shape.Marker(static_cast<int>(i)), off = *summary.shifts_mm[i], at = truth + off;
    const double radius = truth.head<2>().norm();
    r += std::pow(at.head<2>().norm() - radius, 2);
    phi += std::pow((truth.x() * off.y() - truth.y() * off.x()) / radius, 2);
    z += off.z() * off.z();
    all += off.squaredNorm();
    ++summary.markers_used;
  }
  const double used = std::max(1, summary.markers_used);
  summary.rmse_r_mm = std::sqrt(r / used);
  summary.rmse_phi_r_mm = std::sqrt(phi / used);
  summary.rmse_z_mm = std::sqrt(z / used);
  summary.rmse_3d_mm = std::sqrt(all / used);
}

}  // namespace

Result<CameraCalibration> CalibrateCamera(const RestShape& shape, CameraId id,
                                          std::span<const MarkerObservation> rest,
                                          const CalibrationOptions& options) {
  auto fit = FitOne(shape, id, rest, options);
  if (!fit) return fit.error();
  CameraCalibration result = Judge(shape, fit->camera, *fit, rest, options);
  result.sigmas = SigmasOf(fit->bundle.covariance, 0);
  if (auto good = CheckCamera(shape.model(), id, result, options); !good) return good.error();
  return result;
}

Result<CalibrationSummary> CalibrateFromRest(const RestShape& shape, const LabelledMarkers& rest,
                                             const CalibrationOptions& options) {
  const LinkModel& model = shape.model();
  std::array<CameraFit, kCameraCount> fits;
  for (const CameraId id : kBothCameras) {
    Tell(options, 0.25 * static_cast<double>(Index(id)), std::string("fit the ") + Name(id) + " camera");
    auto fit = FitOne(shape, id, rest.cameras[Index(id)], options);
    if (!fit) return fit.error();
    fits[Index(id)] = *std::move(fit);
  }
  Tell(options, 0.5, "adjust both cameras together");
  auto bundle = AdjustBoth(shape, fits, options);
  if (!bundle) return bundle.error();
  Tell(options, 0.9, "check the result");
  CalibrationSummary summary;
  summary.covariance = bundle->covariance;
  summary.departure_cost = bundle->tolerance_cost;
  summary.error_shares = bundle->mode_shares;
  summary.error_covariance = bundle->mode_covariance;
  double squares = 0, used = 0;
  for (const CameraId id : kBothCameras) {
    CameraCalibration& one = summary.cameras[Index(id)];
    one = Judge(shape, bundle->cameras[Index(id)], fits[Index(id)], rest.cameras[Index(id)], options);
    one.sigmas = SigmasOf(bundle->covariance, Index(id));
    summary.rig[id] = one.camera;
    squares += one.rms_px * one.rms_px * one.markers_used;
    used += one.markers_used;
  }
  summary.rms_px = std::sqrt(squares / used);
  MeasureShifts(shape, rest, options, summary);
  if (const auto dent = FindDent(shape, summary, options.max_dent_mm)) return Refusal(Describe(model, *dent));
  for (const CameraId id : kBothCameras) {
    if (auto good = CheckCamera(model, id, summary.cameras[Index(id)], options); !good) return good.error();
  }
  if (auto good = CheckBoth(model, summary, options); !good) return good.error();
  if (summary.markers_used < kLeastMarkers) return Refusal("fewer than 8 markers are seen by both cameras");
  Tell(options, 1, "done");
  return summary;
}

}  // namespace taclink
