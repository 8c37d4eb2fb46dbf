#include "sensing/estimation/camera_evidence.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr double kSameOffsetMm = 0.01;
constexpr double kSettledMm = 0.005, kLongestStepMm = 20;  // of a triangulation

bool IsUsable(const MarkerObservation& o) {
  return o.seen && o.center_px.allFinite() && o.covariance_px2.allFinite() &&
         o.covariance_px2.diagonal().minCoeff() >= 0;
}

}  // namespace

CameraEvidence::CameraEvidence(const LinkModel& model, const StereoRig& rig,
                               const CameraEvidenceOptions& options)
    : options_(options),
      paths_(model.markers.paths),
      rings_(model.markers.rings()),
      projectors_{Projector(rig[CameraId::kTop]), Projector(rig[CameraId::kBottom])},
      rest_mm_(model.RestMarkers()),
      looks_(model, {projectors_[0].center_in_link(), projectors_[1].center_in_link()}),
      observations_(rest_mm_.size() * kCameraCount),
      is_suspect_(rest_mm_.size()) {
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
  const auto m = static_cast<size_t>(marker);
  if (options_.domes) o.seen_offset = looks_.Offset(m, camera);
  const auto projected = projectors_[camera].ProjectWithJacobian(rest_mm_[m] + u + o.seen_offset);
  if (!projected) return;
  o.linear = true;
  o.at = u;
  o.projected = projected->pixel;
  o.jacobian = projected->jacobian;
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
  const int paths = paths_;
  for (int ring = 0; ring < rings_; ++ring) {
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
  std::fill(is_suspect_.begin(), is_suspect_.end(), 0);
  const Mat2 camera = options_.camera_sigma_px * options_.camera_sigma_px * Mat2::Identity();
  static const MarkerObservation kUnseen;
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    const size_t c = i % kCameraCount, marker = i / kCameraCount;
    const auto& all = markers.cameras[c];
    const MarkerObservation& seen = marker < all.size() ? all[marker] : kUnseen;
    o.seen = IsUsable(seen);
    o.dropped = false;
    if (!o.seen) continue;
    o.pixel = seen.center_px - o.residual;
    const double drift2 =
        options_.residual_drift * options_.residual_drift * (o.pixel - o.rest_px).squaredNorm();
    o.covariance = seen.covariance_px2 + o.residual_covariance + camera + drift2 * Mat2::Identity();
    o.weight = o.covariance.inverse();
  }
}

// The point nearest to both rays, by Gauss and Newton. Returns how far they pass each other by, chi^2.
double CameraEvidence::Triangulate(int marker, Vec3& place, Mat3& information) {
  constexpr int kMostSteps = 6;
  double chi2 = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    information.setZero();
    Vec3 pull = Vec3::Zero();
    chi2 = 0;
    for (size_t c = 0; c < kCameraCount; ++c) {
      Observation& o = observations_[static_cast<size_t>(marker) * kCameraCount + c];
      Linearise(o, c, marker, place);
      if (o.at != place) return -1;  // no camera sees that place
      const Vec2 error = o.pixel - o.projected;
      information.noalias() += o.jacobian.transpose() * o.weight * o.jacobian;
      pull.noalias() += o.jacobian.transpose() * (o.weight * error);
      chi2 += error.dot(o.weight * error);
    }
    const Vec3 by = information.ldlt().solve(pull);
    if (!by.allFinite()) return -1;
    if (by.norm() < kSettledMm) return chi2;
    place += by * std::min(1.0, kLongestStepMm / by.norm());
  }
  return chi2;
}

void CameraEvidence::Measure(const Eigen::VectorXd& u, MarkerObservations& observed) {
  observed.displacement_mm.assign(rest_mm_.size(), Vec3::Zero());
  observed.information.assign(rest_mm_.size(), Mat3::Zero());
  for (size_t m = 0; m < rest_mm_.size(); ++m) {
    const auto marker = static_cast<int>(m);
    Vec3 place = u.segment<3>(3 * static_cast<Eigen::Index>(m));
    Observation* pair = &observations_[m * kCameraCount];
    if (pair[0].in_use() && pair[1].in_use()) {
      Vec3 met = place;
      Mat3 information;
      const double chi2 = Triangulate(marker, met, information);
      if (chi2 >= 0 && chi2 <= options_.stereo_sigmas * options_.stereo_sigmas) {
        observed.displacement_mm[m] = met;
        observed.information[m] = information;
        continue;
      }
      // One of both is wrong; which one, the estimate without them tells.
      is_suspect_[m] = 1;
      pair[0].dropped = pair[1].dropped = true;
      continue;
    }
    for (size_t c = 0; c < kCameraCount; ++c) {
      Observation& o = pair[c];
      if (!o.in_use()) continue;
      Linearise(o, c, marker, place);
      const Vec2 error = o.pixel - o.projected - o.jacobian * (place - o.at);
      const Mat3 information = o.jacobian.transpose() * o.weight * o.jacobian;
      const Vec3 pull = o.jacobian.transpose() * (o.weight * error);
      const Mat3 weak = 1e-6 * information.trace() * Mat3::Identity();
      observed.displacement_mm[m] = place + Mat3(information + weak).ldlt().solve(pull);
      observed.information[m] = information;
    }
  }
}

double CameraEvidence::Misfit(size_t observation, const Vec3& u, const Mat3& covariance) {
  Observation& o = observations_[observation];
  Linearise(o, observation % kCameraCount, static_cast<int>(observation / kCameraCount), u);
  const Vec2 error = o.pixel - o.projected - o.jacobian * (u - o.at);
  const Mat2 expected = o.covariance + o.jacobian * covariance * o.jacobian.transpose();
  return error.dot(expected.inverse() * error);
}

bool CameraEvidence::Reconsider(const Eigen::VectorXd& u, std::span<const Mat3> covariances) {
  const double limit = options_.outlier_sigmas * options_.outlier_sigmas;
  bool changed = false;
  for (size_t i = 0; i < observations_.size(); ++i) {
    Observation& o = observations_[i];
    const size_t m = i / kCameraCount;
    if (!o.seen || !o.linear || (o.dropped && !is_suspect_[m])) continue;
    const bool fits = Misfit(i, u.segment<3>(3 * static_cast<Eigen::Index>(m)), covariances[m]) < limit;
    if (fits == !o.dropped) continue;
    // Of a suspect pair one may come back.
    if (fits && !observations_[i ^ 1].dropped) continue;
    o.dropped = !fits;
    changed = true;
  }
  return changed;
}

}  // namespace taclink
