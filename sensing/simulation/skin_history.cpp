#include "sensing/simulation/skin_history.h"

namespace taclink {
namespace {

SkinLoad DividedBy(double share, const SkinLoad& load) {
  SkinLoad elastic = load;
  elastic.pressure_mpa /= share;
  elastic.specific_force_mps2 /= share;
  elastic.wall_stiffness /= share;
  for (SkinDisc& disc : elastic.discs)
    if (disc.force_n) *disc.force_n /= share;
  return elastic;
}

}  // namespace

SkinLoad SkinHistory::RelaxedLoad(const SkinLoad& load) const {
  if (!any()) return load;
  return DividedBy(RelaxationFilter<double>(relaxation_, 0).Relaxed(), load);
}

SkinLoad SkinHistory::ElasticLoad(const SkinLoad& load, double time_s) const {
  if (!filter_) return load;
  const double span_s = Since(time_s), share = filter_->Instant(span_s);
  SkinLoad elastic = DividedBy(share, load);
  elastic.dead_n = filter_->Memory(span_s) / -share;
  return elastic;
}

void SkinHistory::Begin(double time_s, const Eigen::VectorXd& elastic_n) {
  if (!any()) return;
  filter_.emplace(relaxation_, elastic_n);
  time_s_ = time_s;
}

void SkinHistory::Begin(double time_s, const Eigen::VectorXd& elastic_n, const Eigen::VectorXd& external_n) {
  if (!any()) return;
  Begin(time_s, elastic_n);
  filter_->SetExternal(external_n);
}

void SkinHistory::Advance(double time_s, const Eigen::VectorXd& elastic_n) {
  if (!filter_) return;
  filter_->Advance(elastic_n, Since(time_s));
  time_s_ = std::max(time_s_, time_s);
}

}  // namespace taclink
