#include "sensing/estimation/camera_evidence.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr double kSameOffsetMm = 0.01;
// An obstruction displaces the markers behind it. Where it does so along the epipolar line, both rays still
// meet, at a wrong point. A pair is suspect if at least this many of its eight neighbors (five at the end
// rings) have rays that miss.
constexpr int kLeastSuspectNeighbors = 3;
constexpr double kTriangulatedMm = 0.005, kLongestTriangulationMm = 20;  // of a triangulation

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
      suspicion_(rest_mm_.size()) {
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
    const bool had_baseline = keep_unseen && o.residual_of != ResidualOf::kRing;
    const bool was_shown = keep_unseen && o.residual_of == ResidualOf::kMarker;
    const Vec2 before_px = o.residual, rest_before_px = o.rest_px;
    o.dropped = false;
    Linearise(o, camera, static_cast<int>(marker), u.segment<3>(3 * static_cast<Eigen::Index>(marker)));
    o.rest_px = o.projected;
    o.residual_of = had_baseline ? ResidualOf::kBaselineBefore : ResidualOf::kRing;
    o.change.reset();
    if (marker >= rest.cameras[camera].size() || !IsUsable(rest.cameras[camera][marker]) || !o.linear) {
      o.residual_covariance += DriftOver(o.rest_px - rest_before_px);
      continue;
    }
    const MarkerObservation& seen = rest.cameras[camera][marker];
    o.residual = seen.center_px - o.projected;
    o.residual_covariance =
        seen.covariance_px2 + options_.rest_sigma_px * options_.rest_sigma_px * Mat2::Identity();
    if (was_shown) o.change = o.residual - before_px;
    if (keep_unseen || o.residual.norm() <= options_.max_residual_px) o.residual_of = ResidualOf::kMarker;
  }
  FillUnknownResiduals();
}

Mat2 CameraEvidence::DriftOver(const Vec2& moved_px) const {
  return options_.residual_drift * options_.residual_drift * moved_px.squaredNorm() * Mat2::Identity();
}

// What the markers of one ring have in common in one camera: domes and lenses look alike all round, air and
// creep move a ring alike.
struct CameraEvidence::InRing {
  double outward_px = 0, square_px2 = 0;  // means
  int known = 0;

  void Add(const Vec2& residual, const Vec2& outward) {
    outward_px += residual.dot(outward);
    square_px2 += residual.squaredNorm();
    ++known;
  }
  void Finish() {
    if (known == 0) return;
    outward_px /= known;
    square_px2 /= known;
  }
  bool tells() const { return known > 2; }
  double scatter_px2() const { return std::max(0.0, square_px2 - outward_px * outward_px); }
};

// A marker that the rest pictures do not show has the residual of its ring, or the one that it had in the
// baseline before, changed as its ring's has: else what moved the skin since would be in its every frame.
void CameraEvidence::FillUnknownResiduals() {
  double changes_px2 = 0;
  int changes = 0;
  for (const Observation& o : observations_) {
    if (!o.change) continue;
    changes_px2 += o.change->squaredNorm();
    ++changes;
  }
  const double any_change_px2 = changes_px2 / std::max(1, changes);
  for (int ring = 0; ring < rings_; ++ring) {
    for (size_t c = 0; c < kCameraCount; ++c) FillRing(ring, c, any_change_px2);
  }
}

void CameraEvidence::FillRing(int ring, size_t camera, double any_change_px2) {
  const Vec2 middle = projectors_[camera].model().lens.principal_point_px;
  const auto at = [&](int path) -> Observation& {
    return observations_[static_cast<size_t>(ring * paths_ + path) * kCameraCount + camera];
  };
  const auto outward = [&](const Observation& o) -> Vec2 { return (o.rest_px - middle).normalized(); };
  const double unknown_px2 = options_.unknown_residual_px * options_.unknown_residual_px;
  InRing change;
  for (int path = 0; path < paths_; ++path) {
    if (const Observation& o = at(path); o.change) change.Add(*o.change, outward(o));
  }
  change.Finish();
  InRing residual;
  for (int path = 0; path < paths_; ++path) {
    Observation& o = at(path);
    if (o.residual_of == ResidualOf::kBaselineBefore) {
      if (change.tells()) o.residual += change.outward_px * outward(o);
      const double doubt_px2 = change.tells() ? change.scatter_px2() : any_change_px2;
      if (o.residual_covariance.trace() < 2 * unknown_px2)
        o.residual_covariance += doubt_px2 * Mat2::Identity();
    }
    if (o.residual_of != ResidualOf::kRing) residual.Add(o.residual, outward(o));
  }
  residual.Finish();
  const double scatter_px2 =
      residual.tells() ? std::max(residual.scatter_px2(), 0.04 * unknown_px2) : unknown_px2;
  for (int path = 0; path < paths_; ++path) {
    Observation& o = at(path);
    if (o.residual_of != ResidualOf::kRing) continue;
    o.residual = residual.outward_px * outward(o);
    o.residual_covariance = scatter_px2 * Mat2::Identity();
  }
}

void CameraEvidence::Observe(const LabelledMarkers& markers) {
  std::fill(suspicion_.begin(), suspicion_.end(), Suspicion::kNone);
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
    o.covariance = seen.covariance_px2 + o.residual_covariance + camera + DriftOver(o.pixel - o.rest_px);
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
    if (by.norm() < kTriangulatedMm) return chi2;
    place += by * std::min(1.0, kLongestTriangulationMm / by.norm());
  }
  return chi2;
}

void CameraEvidence::Measure(const Eigen::VectorXd& u, MarkerObservations& observed) {
  observed.displacement_mm.assign(rest_mm_.size(), Vec3::Zero());
  observed.information.assign(rest_mm_.size(), Mat3::Zero());
  for (size_t m = 0; m < rest_mm_.size(); ++m) {
    const auto marker = static_cast<int>(m);
    const Vec3 place = u.segment<3>(3 * static_cast<Eigen::Index>(m));
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
      suspicion_[m] = Suspicion::kRaysApart;
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
  DropAmongSuspects(observed);
}

bool CameraEvidence::IsAmongSuspects(int marker) const {
  const int ring = marker / paths_, path = marker % paths_;
  int suspects = 0;
  for (int r = std::max(0, ring - 1); r <= std::min(rings_ - 1, ring + 1); ++r) {
    for (const int by : {-1, 0, 1}) {
      const auto neighbor = static_cast<size_t>(r * paths_ + (path + by + paths_) % paths_);
      suspects += suspicion_[neighbor] == Suspicion::kRaysApart ? 1 : 0;
    }
  }
  return suspects >= kLeastSuspectNeighbors;
}

void CameraEvidence::DropAmongSuspects(MarkerObservations& observed) {
  for (size_t m = 0; m < suspicion_.size(); ++m) {
    Observation* pair = &observations_[m * kCameraCount];
    if (suspicion_[m] != Suspicion::kNone || !pair[0].in_use() || !pair[1].in_use()) continue;
    if (!IsAmongSuspects(static_cast<int>(m))) continue;
    suspicion_[m] = Suspicion::kAmongSuspects;
    pair[0].dropped = pair[1].dropped = true;
    observed.displacement_mm[m].setZero();
    observed.information[m].setZero();
  }
}

void CameraEvidence::Residuals(const Eigen::VectorXd& u, ImageResiduals& residuals) const {
  for (auto& camera : residuals) camera.assign(rest_mm_.size(), std::nullopt);
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Observation& o = observations_[i];
    const size_t m = i / kCameraCount, c = i % kCameraCount;
    if (!o.seen || o.residual_of == ResidualOf::kRing) continue;
    const Vec3 moved_mm = u.segment<3>(3 * static_cast<Eigen::Index>(m));
    const auto pixel = projectors_[c].Project(rest_mm_[m] + moved_mm + o.seen_offset);
    if (!pixel) continue;
    const Vec2 error = o.pixel - *pixel;
    residuals[c][m] = {.px = error, .sigmas = std::sqrt(error.dot(o.weight * error))};
  }
}

CameraAgreement CameraEvidence::Agreement() const {
  CameraAgreement agreement;
  for (size_t m = 0; m < suspicion_.size(); ++m) {
    const Observation* pair = &observations_[m * kCameraCount];
    agreement.pairs += pair[0].seen && pair[1].seen ? 1 : 0;
    agreement.apart += suspicion_[m] == Suspicion::kRaysApart ? 1 : 0;
  }
  return agreement;
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
    if (!o.seen || !o.linear || (o.dropped && suspicion_[m] == Suspicion::kNone)) continue;
    const bool fits = Misfit(i, u.segment<3>(3 * static_cast<Eigen::Index>(m)), covariances[m]) < limit;
    if (fits == !o.dropped) continue;
    // Of a pair whose rays do not meet one may come back.
    if (fits && suspicion_[m] == Suspicion::kRaysApart && !observations_[i ^ 1].dropped) continue;
    o.dropped = !fits;
    changed = true;
  }
  return changed;
}

}  // namespace taclink
