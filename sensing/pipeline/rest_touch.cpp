#include "sensing/pipeline/rest_touch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sensing/camera/bundle.h"
#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"
#include "sensing/pipeline/touch_selection.h"

namespace taclink {
namespace {

// Of the squared residuals without image noise, and of these squares by themselves. Touches by 0.05 N and
// more on both shipped skins, slack and at 0.5 kPa, explain 0.98 and 13.7 at least; of smooth errors of the
// mould of 0.2 to 0.3 mm (RMS, harmonics 1 to 5 around and 1 to 3 along) 0.4 and 13.5 at most.
constexpr double kLeastShare = 0.6, kLeastGain = 12;
constexpr int kMostForces = 2;         // a plate is not a point, and the response is not linear
constexpr double kSigmaFloorPx = 0.1;  // a detection is not believed to be better than this
constexpr double kMostSigmaPx = 2;     // clipped ones do not count
constexpr Eigen::Index kNuisanceOfCameras = kCameraCount * kCameraParameters;
// Smooth radial errors of the mould: harmonics around and along the link, each of the standard deviation of a
// marker's own error.
constexpr int kMouldAround = 5, kMouldAlong = 3;
constexpr Eigen::Index kNuisanceOfMould = (2 * kMouldAround + 1) * (kMouldAlong + 1);

Eigen::Matrix<double, 3, kNuisanceOfMould> MouldModes(const LinkModel& model, int marker) {
  const Vec3 at = model.RestMarker(marker);
  const double angle = std::atan2(at.y(), at.x());
  Eigen::Matrix<double, 1, kNuisanceOfMould> size;
  Eigen::Index mode = 0;
  for (int along = 0; along <= kMouldAlong; ++along) {
    const double share = std::cos(along * kPi * at.z() / model.length_mm);
    size[mode++] = share;
    for (int around = 1; around <= kMouldAround; ++around) {
      size[mode++] = share * std::cos(around * angle);
      size[mode++] = share * std::sin(around * angle);
    }
  }
  return Vec3(std::cos(angle), std::sin(angle), 0) * size;
}

// y = nuisance a + touches f + noise of unit variance, a with a prior of precision `prior`.
struct Equations {
  Eigen::VectorXd y;
  Eigen::MatrixXd nuisance, touches;
  Eigen::VectorXd prior;
  double image_noise = 0;  // expected value of its squares in y
};

// One marker in all images that show it. Its error in the mould is the same in both.
struct MarkerRows {
  Eigen::Vector4d y = Eigen::Vector4d::Zero();
  Eigen::Matrix<double, 4, kNuisanceOfCameras> by_cameras =
      Eigen::Matrix<double, 4, kNuisanceOfCameras>::Zero();
  Eigen::Matrix<double, 4, 3> by_point = Eigen::Matrix<double, 4, 3>::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Identity();
  Eigen::Matrix4d image_noise = Eigen::Matrix4d::Zero();
  Eigen::Index rows = 0;
};

MarkerRows RowsOf(const RestShape& shape, const std::array<Projector, kCameraCount>& projectors,
                  const LabelledMarkers& rest, int marker) {
  MarkerRows rows;
  for (const CameraId id : kBothCameras) {
    const MarkerObservation& seen = rest.cameras[Index(id)][static_cast<size_t>(marker)];
    if (!seen.seen || !(seen.sigma_px() <= kMostSigmaPx)) continue;
    const Projector& projector = projectors[Index(id)];
    const auto expected =
        projector.ProjectWithCameraJacobian(SeenPoint(shape, marker, projector.center_in_link(), true));
    if (!expected) continue;
    const Eigen::Index at = rows.rows;
    rows.y.segment<2>(at) = seen.center_px - expected->pixel;
    rows.by_cameras.block<2, kCameraParameters>(
        at, static_cast<Eigen::Index>(Index(id)) * kCameraParameters) = expected->by_camera;
    rows.by_point.middleRows<2>(at) = expected->by_point;
    rows.image_noise.block<2, 2>(at, at) = seen.covariance_px2;
    rows.covariance.block<2, 2>(at, at) =
        seen.covariance_px2 + kSigmaFloorPx * kSigmaFloorPx * Mat2::Identity();
    rows.rows += 2;
  }
  return rows;
}

// Adds for each ring what the same force at each of its markers does; and last what the same outward, and the
// same inward force at all markers does, as pressure that is higher or lower than known.
void AddRingsAndInflation(const MarkerGrid& grid, Eigen::MatrixXd& touches) {
  const Eigen::Index markers = touches.cols();
  touches.conservativeResize(Eigen::NoChange, markers + grid.rings() + 2);
  touches.rightCols<1>() = touches.leftCols(markers).rowwise().sum();
  touches.col(markers + grid.rings()) = -touches.rightCols<1>();
  for (int ring = 0; ring < grid.rings(); ++ring) {
    auto all_around = touches.col(markers + ring);
    all_around.setZero();
    for (int path = 0; path < grid.paths; ++path) all_around += touches.col(ring * grid.paths + path);
  }
}

Equations EquationsOf(const RestShape& shape, const Eigen::MatrixXf& responses, const StereoRig& rig,
                      const LabelledMarkers& rest, double mould_mm) {
  const std::array projectors = {Projector(rig[CameraId::kTop]), Projector(rig[CameraId::kBottom])};
  const int markers = shape.model().markers.count();
  const Eigen::Index loads = shape.errors_mm().cols(), first_load = kNuisanceOfCameras + kNuisanceOfMould;
  Equations all;
  all.y.resize(4 * markers);
  all.nuisance.resize(4 * markers, first_load + loads);
  all.touches.resize(4 * markers, responses.cols());
  Eigen::Index end = 0;
  for (int m = 0; m < markers; ++m) {
    MarkerRows one = RowsOf(shape, projectors, rest, m);
    if (one.rows == 0) continue;
    one.covariance += mould_mm * mould_mm * one.by_point * one.by_point.transpose();
    // Rows beyond `rows` are zero but for the covariance's diagonal.
    const Eigen::LLT<Eigen::Matrix4d> noise(one.covariance);
    const Eigen::Matrix<double, 4, 3> by_point = noise.matrixL().solve(one.by_point);
    all.image_noise += noise.solve(one.image_noise).trace();
    all.y.segment(end, one.rows) = noise.matrixL().solve(one.y).head(one.rows);
    all.nuisance.block(end, 0, one.rows, kNuisanceOfCameras) =
        noise.matrixL().solve(one.by_cameras).topRows(one.rows);
    all.nuisance.block(end, kNuisanceOfCameras, one.rows, kNuisanceOfMould) =
        mould_mm * by_point.topRows(one.rows) * MouldModes(shape.model(), m);
    if (loads > 0)
      all.nuisance.block(end, first_load, one.rows, loads) =
          by_point.topRows(one.rows) * shape.errors_mm().middleRows<3>(3 * m);
    all.touches.middleRows(end, one.rows) =
        by_point.topRows(one.rows) * responses.middleRows<3>(3 * m).cast<double>();
    end += one.rows;
  }
  all.y.conservativeResize(end);
  all.nuisance.conservativeResize(end, Eigen::NoChange);
  all.touches.conservativeResize(end, Eigen::NoChange);
  AddRingsAndInflation(shape.model().markers, all.touches);
  // Cameras are known by the build's tolerances, their lenses not at all.
  const BuildTolerance tolerance;
  CameraStep sigmas = CameraStep::Constant(1e9);
  sigmas.head<8>() << tolerance.tilt_rad, tolerance.tilt_rad, tolerance.roll_rad,
      Vec3::Constant(tolerance.place_mm), Vec2::Constant(tolerance.principal_point_px);
  all.prior = Eigen::VectorXd::Ones(first_load + loads);
  for (Eigen::Index c = 0; c < static_cast<Eigen::Index>(kCameraCount); ++c)
    all.prior.segment<kCameraParameters>(c * kCameraParameters) = sigmas.array().square().inverse();
  return all;
}

// Eliminates the nuisance parameters.
TouchEquations Eliminate(const Equations& all) {
  // Parameters differ by many orders of magnitude in their units.
  const Eigen::VectorXd units =
      (all.nuisance.colwise().squaredNorm().transpose() + all.prior).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd nuisance = all.nuisance * units.asDiagonal();
  Eigen::MatrixXd information = nuisance.transpose() * nuisance;
  information.diagonal() += all.prior.cwiseProduct(units.cwiseAbs2());
  information.diagonal().array() += 1e-12;  // parameters that a lens does not have
  const Eigen::LDLT<Eigen::MatrixXd> factor(information);
  const Eigen::VectorXd by_y = nuisance.transpose() * all.y;
  const Eigen::MatrixXd by_touches = nuisance.transpose() * all.touches;
  const Eigen::MatrixXd solved = factor.solve(by_touches);
  TouchEquations reduced;
  reduced.squares = all.y.squaredNorm() - by_y.dot(factor.solve(by_y));
  reduced.pulls = all.touches.transpose() * all.y - solved.transpose() * by_y;
  reduced.normal = all.touches.transpose() * all.touches - by_touches.transpose() * solved;
  return reduced;
}

// Where the forces together press deepest among the places at which they act.
RestTouch DeepestOf(const SelectedTouches& forces, const LinkModel& model, const Eigen::MatrixXf& responses,
                    double share) {
  const int markers = model.markers.count(), paths = model.markers.paths;
  Eigen::VectorXf at_markers_n = Eigen::VectorXf::Zero(markers);
  for (size_t i = 0; i < static_cast<size_t>(forces.count); ++i) {
    const auto force_n = static_cast<float>(forces.force_n[i]);
    if (const auto ring = forces.at[i] - markers; ring >= model.markers.rings())
      at_markers_n.array() -= ring == model.markers.rings() ? force_n : -force_n;
    else if (ring >= 0)
      at_markers_n.segment(ring * paths, paths).array() += force_n;
    else
      at_markers_n[forces.at[i]] += force_n;
  }
  const Eigen::VectorXf moved_mm = responses * at_markers_n;
  RestTouch deepest{.share = share};
  for (size_t i = 0; i < static_cast<size_t>(forces.count); ++i) {
    const auto ring = forces.at[i] - markers;
    if (ring >= model.markers.rings()) continue;
    const auto marker = static_cast<int>(ring >= 0 ? ring * paths : forces.at[i]);
    const double depth_mm = static_cast<double>(moved_mm.segment<3>(3 * marker).norm());
    if (depth_mm <= deepest.depth_mm) continue;
    deepest.marker = marker;
    deepest.is_around = ring >= 0;
    deepest.depth_mm = depth_mm;
  }
  return deepest;
}

}  // namespace

std::optional<RestTouch> FindRestTouch(const RestShape& shape, const Eigen::MatrixXf& responses,
                                       const StereoRig& rig, const LabelledMarkers& rest, double mould_mm) {
  const Equations all = EquationsOf(shape, responses, rig, rest, mould_mm);
  const TouchEquations reduced = Eliminate(all);
  const SelectedTouches forces = SelectTouches(reduced, kMostForces, TouchSign::kPush);
  const double unexplained = reduced.squares - forces.gain - all.image_noise;
  double gain = forces.gain;  // of what presses, beside what another pressure explains
  const Eigen::Index most = forces.count > 0 ? forces.at[0] : 0;
  if (most >= reduced.pulls.size() - 2)
    gain -= reduced.pulls[most] * reduced.pulls[most] / reduced.normal(most, most);
  const double share = gain / (gain + std::max(0.0, unexplained));
  if (!(gain >= kLeastGain && share >= kLeastShare)) return std::nullopt;
  return DeepestOf(forces, shape.model(), responses, share);
}

std::string Describe(const LinkModel& model, const RestTouch& touch) {
  char where[60], text[400];
  if (touch.is_around)
    std::snprintf(where, sizeof where, "all around at ring %d", model.RingOf(touch.marker) + 1);
  else
    std::snprintf(where, sizeof where, "near path %d, ring %d", model.PathOf(touch.marker) + 1,
                  model.RingOf(touch.marker) + 1);
  std::snprintf(
      text, sizeof text,
      "the skin is touched %s: it is pressed in by about %.1f mm; take the rest images again with "
      "nothing at the skin; if nothing is there, a camera has moved since it was calibrated, or the "
      "skin is not shaped as the model says",
      where, touch.depth_mm);
  return text;
}

}  // namespace taclink
