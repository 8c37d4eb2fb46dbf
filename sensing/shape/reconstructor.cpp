#include "sensing/shape/reconstructor.h"

#include <Eigen/Cholesky>

namespace taclink {
namespace {

// Where nothing was measured the estimate stands in, without information.
constexpr double kNoInformation = 1e-9;  // 1/mm^2
constexpr int kMostPasses = 3;
constexpr double kSameLookMm = 0.1;

// R M R^T of a symmetric M, R a turn about Z.
Mat3 Turned(const Mat3& r, const Mat3& m) {
  const double c = r(0, 0), s = r(1, 0), cross = 2 * c * s * m(0, 1);
  const double xx = c * c * m(0, 0) + s * s * m(1, 1) - cross;
  const double yy = s * s * m(0, 0) + c * c * m(1, 1) + cross;
  const double xy = c * s * (m(0, 0) - m(1, 1)) + (c * c - s * s) * m(0, 1);
  const double xz = c * m(0, 2) - s * m(1, 2), yz = s * m(0, 2) + c * m(1, 2);
  Mat3 turned;
  turned << xx, xy, xz, xy, yy, yz, xz, yz, m(2, 2);
  return turned;
}

MarkerSource SourceOf(bool top, bool bottom) {
  if (top) return bottom ? MarkerSource::kBoth : MarkerSource::kTop;
  return bottom ? MarkerSource::kBottom : MarkerSource::kInferred;
}

}  // namespace

ShapeReconstructor::ShapeReconstructor(const LinkModel& model, const StereoRig& rig,
                                       const ShapeOptions& options)
    : model_rest_mm_(model.RestMarkers()),
      estimator_(model, options.estimator),
      evidence_(model, rig, estimator_.basis(), options.cameras),
      doubt_(model, rig, options.calibration_covariance),
      rest_u_(Eigen::VectorXd::Zero(3 * model.markers.count())) {}

void ShapeReconstructor::SetBaseline(const LabelledMarkers& rest, double pressure_mpa, bool keep_unseen) {
  rest_u_ = pressure_mpa * estimator_.basis().per_pressure();
  evidence_.SetBaseline(rest, rest_u_, keep_unseen);
  estimator_.Reset();
}

void ShapeReconstructor::SetBaseline(const LabelledMarkers& rest, double pressure_mpa) {
  SetBaseline(rest, pressure_mpa, false);
}

void ShapeReconstructor::Tare(const LabelledMarkers& now, double pressure_mpa) {
  SetBaseline(now, pressure_mpa, true);
}

Vec3 ShapeReconstructor::PressureDisplacement(int marker, double change_mpa) const {
  const SkinBasis& basis = estimator_.basis();
  return basis.Frame(marker) * (change_mpa * basis.per_pressure().segment<3>(3 * marker));
}

void ShapeReconstructor::Reconstruct(const LabelledMarkers& markers, std::optional<double> pressure_mpa,
                                     SkinShape& shape) {
  evidence_.Observe(markers);
  for (int pass = 0; pass < kMostPasses; ++pass) {
    estimator_.Estimate(evidence_, {pressure_mpa.value_or(0), pressure_mpa.has_value()});
    // A step between frames is small, and the next frame has it.
    if (evidence_.UpdateLooks(estimator_.displacements()) < kSameLookMm) break;
  }
  Write(shape);
}

void ShapeReconstructor::Write(SkinShape& shape) const {
  const size_t count = model_rest_mm_.size();
  shape.positions_mm.resize(count);
  shape.displacements_mm.resize(count);
  shape.covariances_mm2.resize(count);
  shape.sources.resize(count);
  shape.measured.resize(count);
  shape.rejected.clear();
  for (size_t i = 0; i < count; ++i) {
    const auto marker = static_cast<int>(i);
    const Mat3& frame = estimator_.basis().Frame(marker);
    const Vec3 u = estimator_.displacements().segment<3>(3 * marker);
    shape.positions_mm[i] = model_rest_mm_[i] + frame * u;
    shape.displacements_mm[i] = frame * (u - rest_u_.segment<3>(3 * marker));
    shape.covariances_mm2[i] =
        Turned(frame, estimator_.covariances()[i]) + doubt_.Of(i, shape.displacements_mm[i]);
    shape.sources[i] =
        SourceOf(evidence_.Uses(marker, CameraId::kTop), evidence_.Uses(marker, CameraId::kBottom));
    for (const CameraId id : kBothCameras) {
      if (evidence_.IsDropped(marker, id)) shape.rejected.push_back({id, marker});
    }
    // The evidence is linear about the solver's estimate.
    const MarkerEvidence& exact = evidence_.exact()[i];
    const Vec3 about = estimator_.solver().displacements().segment<3>(3 * marker);
    const Mat3 information = exact.information + kNoInformation * Mat3::Identity();
    const Vec3 measured = about + information.llt().solve(exact.pull);
    shape.measured[i] = {frame * (measured - rest_u_.segment<3>(3 * marker)),
                         Turned(frame, exact.information)};
  }
}

}  // namespace taclink
