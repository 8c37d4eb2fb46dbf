#include "sensing/pipeline/creep_history.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

// In units of the coarser marker pitch: loads of the same contact may be found at other sites.
constexpr double kReachPitches = 2.5;
// A load is dropped if its real share is below kMostlyReal and its real force is below LoadEstimator's own
// limit (kHillGain is the square of kTellingDeviations).
constexpr double kMostlyReal = 0.5, kTellingDeviations = 4.5;
// Sum of forces in units of ForceUnit: it moves no marker by more than the cameras' noise.
constexpr double kNegligibleN = 2e-3;

double CoarserPitchMm(const LinkModel& model) {
  const std::vector<double>& rings = model.markers.rings_z_mm;
  const double along = rings.size() < 2 ? 0 : (rings.back() - rings.front()) / (model.markers.rings() - 1.0);
  const double radius_mm = model.PointAtDepth(0, model.length_mm / 2, 0).head<2>().norm();
  return std::max(along, model.markers.path_pitch_rad() * radius_mm);
}

// `share`: real force over elastic force.
void Scale(double share, EstimatedLoad& load) {
  for (double& inward_n : load.inward_n) inward_n *= share;
  load.tangential_n *= share;
  load.couple_nmm *= share;
  load.left_out_n *= share;
  load.force_n *= share;
  load.normal_force_n *= share;
}

}  // namespace

CreepHistory::CreepHistory(const LinkModel& model) : relaxation_(model.relaxation) {
  if (!any()) return;
  reach_mm_ = kReachPitches * CoarserPitchMm(model);
  negligible_n_ = kNegligibleN * ForceUnit(model);
  for (int m = 0; m < model.markers.count(); ++m) {
    const double angle = model.PathAngle(model.PathOf(m));
    const double z_mm = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(m))];
    inward_.emplace_back(-model.OutwardNormal(angle, z_mm));
    place_mm_.push_back(model.RestMarker(m));
  }
}

void CreepHistory::Forget() {
  pressure_mpa_.reset();
  specific_force_mps2_.reset();
  contacts_.reset();
  now_n_.resize(0);
}

// Elastic load less real load.
template <typename Value>
Value CreepHistory::ByCreep(std::optional<Known<Value>>& known, const Value& real, bool is_measured,
                            double span_s) const {
  if (!known && !is_measured) return Value(0 * real);
  if (!known) {
    const double relaxed = RelaxationFilter<Value>(relaxation_, real).Relaxed();
    known.emplace(Known<Value>{RelaxationFilter<Value>(relaxation_, Value(real / relaxed)), real});
    span_s = 0;
  }
  if (is_measured) known->real = real;
  const Value elastic = known->filter.ToElastic(known->real, span_s);
  known->filter.Advance(elastic, span_s);
  return elastic - known->real;
}

MeasuredLoads CreepHistory::Elastic(const MeasuredLoads& real, const Measured& measured,
                                    int64_t exposure_ns) {
  if (!any()) return real;
  if (exposure_ns < frame_ns_) Forget();
  const double span_s = frame_ns_ == 0 ? 0 : 1e-9 * static_cast<double>(exposure_ns - frame_ns_);
  frame_ns_ = exposure_ns;
  now_n_.resize(0);
  MeasuredLoads loads = real;
  loads.by_creep[0] = ByCreep(pressure_mpa_, real.pressure_mpa, measured.pressure, span_s);
  loads.by_creep.tail<3>() =
      ByCreep(specific_force_mps2_, real.specific_force_mps2, measured.specific_force, span_s);
  loads.pressure_mpa += loads.by_creep[0];
  loads.specific_force_mps2 += loads.by_creep.tail<3>();
  for (size_t i = 0; pressure_mpa_ && i < relaxation_.share_sigmas.size(); ++i)
    loads.pressure_sigma_mpa =
        std::hypot(loads.pressure_sigma_mpa, relaxation_.share_sigmas[i] * pressure_mpa_->filter.ByShare(i));
  return loads;
}

// By marker, the nearest load, which owns the marker's memory. -1: none within reach.
std::vector<int> CreepHistory::OwnersOf(const LumpedForces& elastic_n) const {
  std::vector<int> owners(place_mm_.size(), -1);
  std::vector<double> nearest_mm(place_mm_.size(), reach_mm_);
  for (size_t k = 0; k < elastic_n.size(); ++k) {
    for (size_t loaded = 0; loaded < place_mm_.size(); ++loaded) {
      if (elastic_n[k].segment<3>(3 * static_cast<Eigen::Index>(loaded)).isZero(0)) continue;
      for (size_t m = 0; m < place_mm_.size(); ++m) {
        const double mm = (place_mm_[m] - place_mm_[loaded]).norm();
        if (mm >= nearest_mm[m]) continue;
        nearest_mm[m] = mm;
        owners[m] = static_cast<int>(k);
      }
    }
  }
  return owners;
}

std::vector<CreepHistory::Remembered> CreepHistory::Share(const LumpedForces& elastic_n,
                                                          const Eigen::VectorXd& memory_n) const {
  const size_t sigmas = relaxation_.share_sigmas.size();
  std::vector<Eigen::VectorXd> by_share_n;
  for (size_t i = 0; i < sigmas; ++i) by_share_n.push_back(contacts_->ByShare(i));
  std::vector<Remembered> shares(elastic_n.size());
  for (Remembered& share : shares) share.by_share_n.assign(sigmas, 0);
  const std::vector<int> owners = OwnersOf(elastic_n);
  for (size_t m = 0; m < place_mm_.size(); ++m) {
    for (size_t k = 0; k < shares.size(); ++k) shares[k].elastic_n += Inward(elastic_n[k], m);
    if (owners[m] < 0) continue;
    Remembered& share = shares[static_cast<size_t>(owners[m])];
    share.memory_n += Inward(memory_n, m);
    for (size_t i = 0; i < sigmas; ++i) share.by_share_n[i] += Inward(by_share_n[i], m);
  }
  return shares;
}

void CreepHistory::MakeReal(const LumpedForces& elastic_n, std::vector<EstimatedLoad>& loads) {
  now_n_.setZero(3 * static_cast<Eigen::Index>(place_mm_.size()));
  for (const Eigen::VectorXd& one : elastic_n) now_n_ += one;
  if (!contacts_) return;
  const double span_s = SinceContactsS(), instant = contacts_->Instant(span_s);
  const std::vector<Remembered> remembered = Share(elastic_n, contacts_->Memory(span_s));
  std::vector<EstimatedLoad> real;
  for (size_t k = 0; k < loads.size(); ++k) {
    const Remembered& of = remembered[k];
    EstimatedLoad& load = loads[k];
    const Vec3 direction = load.force_n.norm() > 0 ? Vec3(load.force_n.normalized()) : Vec3(Vec3::Zero());
    const double sigma_n = std::sqrt(direction.dot(load.force_covariance_n2 * direction));
    // A purely tangential load has no memory: only the instant response scales it.
    const double share = of.elastic_n > 0 ? instant + of.memory_n / of.elastic_n : instant;
    const bool tells = share >= kMostlyReal || share * of.elastic_n >= kTellingDeviations * sigma_n;
    if (!(share > 0 && tells)) continue;
    Scale(share, load);
    load.force_covariance_n2 *= instant * instant;
    for (size_t i = 0; i < of.by_share_n.size(); ++i) {
      const double off_n = relaxation_.share_sigmas[i] * of.by_share_n[i];
      load.force_covariance_n2 += off_n * off_n * direction * direction.transpose();
    }
    real.push_back(std::move(load));
  }
  loads = std::move(real);
}

void CreepHistory::Advance() {
  if (now_n_.size() == 0) return;
  if (!contacts_ && now_n_.isZero(0)) return;
  if (!contacts_) {
    contacts_.emplace(relaxation_, Eigen::VectorXd::Zero(now_n_.size()));
    contacts_ns_ = frame_ns_;
  }
  contacts_->Advance(now_n_, SinceContactsS());
  contacts_ns_ = frame_ns_;
}

Eigen::VectorXd CreepHistory::ResidualInward() const {
  if (!contacts_) return {};
  const Eigen::VectorXd left_n = contacts_->ToElastic(0 * contacts_->elastic(), SinceContactsS());
  Eigen::VectorXd inward_n(static_cast<Eigen::Index>(place_mm_.size()));
  for (size_t m = 0; m < place_mm_.size(); ++m) inward_n[static_cast<Eigen::Index>(m)] = Inward(left_n, m);
  if (inward_n.cwiseAbs().sum() < negligible_n_) return {};
  return inward_n;
}

}  // namespace taclink
