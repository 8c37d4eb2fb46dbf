#include "sensing/shape/camera_evidence.h"

#include <Eigen/LU>
#include <cmath>

namespace taclink {
namespace {

constexpr double kSameOffsetMm = 0.01;

bool IsUsable(const MarkerObservation& o) {
  return o.seen && o.center_px.allFinite() && o.covariance_px2.allFinite() &&
         o.covariance_px2.diagonal().minCoeff() >= 0;
}

}  // namespace

CameraEvidence::CameraEvidence(const LinkModel& model, const StereoRig& rig, const SkinBasis& basis,
                               const CameraEvidenceOptions& options)
    : options_(options),
      basis_(basis),
      projectors_{Projector(rig[CameraId::kTop]), Projector(rig[CameraId::kBottom])},
      rest_mm_(model.RestMarkers()),
      looks_(model, basis, {projectors_[0].center_in_link(), projectors_[1].center_in_link()}),
      observations_(rest_mm_.size() * kCameraCount),
      exact_(rest_mm_.size()) {
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    const auto marker = static_cast<int>(i / kCameraCount);
    Linearise(o, i % kCameraCount, marker, Vec3::Zero());
    o.rest_px = o.projected;
    o.residual_covariance = options_.unknown_residual_px * options_.unknown_residual_px * Mat2::Identity();
  }
}

// Where the point can't be projected, the old linearisation stays.
void CameraEvidence::Linearise(Observation& o, size_t camera, int marker, const Vec3& u) const {
  const Mat3& frame = basis_.Frame(marker);
  const auto m = static_cast<size_t>(marker);
  if (options_.domes) o.seen_offset = looks_.Offset(m, camera);
  const auto projected = projectors_[camera].ProjectWithJacobian(rest_mm_[m] + frame * u + o.seen_offset);
  if (!projected) return;
  o.linear = true;
  o.at = u;
  o.projected = projected->pixel;
  o.jacobian.noalias() = projected->jacobian * frame;
}

double CameraEvidence::UpdateLooks(const Eigen::VectorXd& u) {
  if (!options_.domes) return 0;
  const double changed_mm = looks_.Update(u);
  if (changed_mm == 0) return 0;
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    const size_t m = i / kCameraCount, c = i % kCameraCount;
    // Unseen ones too: they may come back when nothing moves any more.
    const double changed2 = (looks_.Offset(m, c) - o.seen_offset).squaredNorm();
    if (changed2 > kSameOffsetMm * kSameOffsetMm) Linearise(o, c, static_cast<int>(m), o.at);
  }
  return changed_mm;
}

void CameraEvidence::SetBaseline(const LabelledMarkers& rest, const Eigen::VectorXd& u, bool keep_unseen) {
  looks_.Update(u);
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    const size_t camera = i % kCameraCount, marker = i / kCameraCount;
    o.dropped = false;
    Linearise(o, camera, static_cast<int>(marker), u.segment<3>(3 * static_cast<Eigen::Index>(marker)));
    o.rest_px = o.projected;
    o.has_baseline = keep_unseen && o.has_baseline;
    if (marker >= rest.cameras[camera].size() || !IsUsable(rest.cameras[camera][marker]) || !o.linear)
      continue;
    const MarkerObservation& seen = rest.cameras[camera][marker];
    o.residual = seen.center_px - o.projected;
    o.residual_covariance =
        seen.covariance_px2 + options_.rest_sigma_px * options_.rest_sigma_px * Mat2::Identity();
    o.has_baseline = keep_unseen || o.residual.norm() <= options_.max_residual_px;
  }
  FillUnknownResiduals();
}

// A marker that the rest pictures do not show gets the mean residual of its ring in that camera, turned to
// its place: domes and lenses look alike all round.
void CameraEvidence::FillUnknownResiduals() {
  const int paths = basis_.paths();
  for (int ring = 0; ring < basis_.rings(); ++ring) {
    for (size_t c = 0; c < kCameraCount; ++c) {
      const Vec2 middle = projectors_[c].model().lens.principal_point_px;
      const auto at = [&](int path) -> Observation& {
        return observations_[static_cast<size_t>(ring * paths + path) * kCameraCount + c];
      };
      double mean = 0, square = 0;
      int known = 0;
      for (int path = 0; path < paths; ++path) {
        const Observation& o = at(path);
        if (!o.has_baseline) continue;
        const double outward = o.residual.dot((o.rest_px - middle).normalized());
        mean += outward;
        square += o.residual.squaredNorm();
        ++known;
      }
      if (known > 0) mean /= known;
      const double unknown2 = options_.unknown_residual_px * options_.unknown_residual_px;
      const double scatter2 = known > 2 ? std::max(square / known - mean * mean, 0.04 * unknown2) : unknown2;
      for (int path = 0; path < paths; ++path) {
        Observation& o = at(path);
        if (o.has_baseline) continue;
        o.residual = mean * (o.rest_px - middle).normalized();
        o.residual_covariance = scatter2 * Mat2::Identity();
      }
    }
  }
}

void CameraEvidence::Observe(const LabelledMarkers& markers) {
  dropped_ = 0;
  const Mat2 camera = options_.camera_sigma_px * options_.camera_sigma_px * Mat2::Identity();
  static const MarkerObservation kUnseen;
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    const size_t c = i % kCameraCount, marker = i / kCameraCount;
    const auto& all = markers.cameras[c];
    const MarkerObservation& seen = marker < all.size() ? all[marker] : kUnseen;
    o.seen = IsUsable(seen);
    if (!o.seen) {
      o.dropped = false;
      continue;
    }
    o.pixel = seen.center_px - o.residual;
    const double drift2 =
        options_.residual_drift * options_.residual_drift * (o.projected - o.rest_px).squaredNorm();
    o.covariance = seen.covariance_px2 + o.residual_covariance + camera + drift2 * Mat2::Identity();
    o.weight = o.covariance.inverse();
    dropped_ += o.dropped ? 1 : 0;
  }
}

void CameraEvidence::Drop(int observation) {
  observations_[static_cast<size_t>(observation)].dropped = true;
  ++dropped_;
}

bool CameraEvidence::Readmit(const Eigen::VectorXd& u, std::span<const Mat3> covariances) {
  const int before = dropped_;
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    if (!o.seen || !o.dropped) continue;
    const size_t marker = i / kCameraCount;
    const Vec3 at = u.segment<3>(3 * static_cast<Eigen::Index>(marker));
    Linearise(o, i % kCameraCount, static_cast<int>(marker), at);
    const Vec2 error = o.pixel - o.projected - o.jacobian * (at - o.at);
    const Mat2 predicted = o.covariance + o.jacobian * covariances[marker] * o.jacobian.transpose();
    o.dropped = error.dot(predicted.inverse() * error) > options_.readmit_sigmas * options_.readmit_sigmas;
    dropped_ -= o.dropped ? 0 : 1;
  }
  return dropped_ < before;
}

void CameraEvidence::Evaluate(const Eigen::VectorXd& u, const Eigen::VectorXd& slack,
                              std::vector<MarkerEvidence>& markers) {
  worst_ = {};
  const double near2 = options_.linear_within_mm * options_.linear_within_mm;
  for (size_t m = 0; m < exact_.size(); ++m) {
    const auto row = 3 * static_cast<Eigen::Index>(m);
    const Vec3 at = u.segment<3>(row), spare = slack.segment<3>(row);
    MarkerEvidence& exact = exact_[m];
    exact = {};
    for (size_t c = 0; c < kCameraCount; ++c) {
      Observation& o = observations_[m * kCameraCount + c];
      if (!o.seen || o.dropped) continue;
      if ((at - o.at).squaredNorm() > near2) Linearise(o, c, static_cast<int>(m), at);
      if (!o.linear) continue;
      const Vec2 error = o.pixel - o.projected - o.jacobian * (at - o.at);
      const Eigen::Matrix<double, 3, 2> weighted = o.jacobian.transpose() * o.weight;
      exact.information.noalias() += weighted * o.jacobian;
      exact.pull.noalias() += weighted * error;
      const Mat2 expected = o.covariance + o.jacobian * spare.asDiagonal() * o.jacobian.transpose();
      const double chi2 = error.dot(expected.inverse() * error);
      exact.chi2 += chi2;
      exact.numbers += 2;
      if (chi2 > worst_.chi2) worst_ = {static_cast<int>(m * kCameraCount + c), static_cast<int>(m), chi2};
    }
    markers[m] = WithSlack(exact, spare);
  }
}

}  // namespace taclink
