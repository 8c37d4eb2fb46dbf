#include "sensing/shape/inference.h"

#include <Eigen/LU>

namespace taclink {
namespace {

/// Displacements in space, one observation a marker.
class MeasuredEvidence : public Evidence {
 public:
  MeasuredEvidence(const SkinBasis& basis, const SkinShape& shape) : seen_(shape.sources.size()) {
    for (size_t m = 0; m < seen_.size(); ++m) {
      const Mat3& frame = basis.Frame(static_cast<int>(m));
      if (shape.sources[m] == MarkerSource::kInferred) continue;
      seen_[m] = {frame.transpose() * shape.measured[m].displacement_mm,
                  frame.transpose() * shape.measured[m].information_per_mm2 * frame, true};
    }
  }

  void Evaluate(const Eigen::VectorXd& u, const Eigen::VectorXd& slack,
                std::vector<MarkerEvidence>& markers) override {
    worst_ = {};
    for (size_t m = 0; m < seen_.size(); ++m) {
      const auto row = 3 * static_cast<Eigen::Index>(m);
      markers[m] = {};
      if (!seen_[m].used) continue;
      const Vec3 error = seen_[m].displacement - u.segment<3>(row);
      markers[m] = WithSlack({seen_[m].information, seen_[m].information * error}, slack.segment<3>(row));
      const double chi2 = error.dot(markers[m].pull);
      markers[m].chi2 = chi2;
      markers[m].numbers = 3;
      if (chi2 > worst_.chi2) worst_ = {static_cast<int>(m), static_cast<int>(m), chi2};
    }
  }

  Misfit Worst() const override { return worst_; }
  void Drop(int observation) override { seen_[static_cast<size_t>(observation)].used = false; }
  bool Readmit(const Eigen::VectorXd&, std::span<const Mat3>) override { return false; }
  int dropped() const override { return 0; }

 private:
  struct Seen {
    Vec3 displacement = Vec3::Zero();
    Mat3 information = Mat3::Zero();
    bool used = false;
  };

  std::vector<Seen> seen_;
  Misfit worst_;
};

}  // namespace

void InferUnseen(const LinkModel& model, const KnownPressure& pressure, SkinShape& shape,
                 const ShapeEstimatorOptions& options) {
  if (shape.CountOf(MarkerSource::kInferred) == 0) return;
  ShapeEstimator estimator(model, options);
  MeasuredEvidence evidence(estimator.basis(), shape);
  estimator.Estimate(evidence, pressure);
  for (size_t m = 0; m < shape.sources.size(); ++m) {
    if (shape.sources[m] != MarkerSource::kInferred) continue;
    const auto marker = static_cast<int>(m);
    const Mat3& frame = estimator.basis().Frame(marker);
    shape.displacements_mm[m] = frame * estimator.displacements().segment<3>(3 * marker);
    shape.positions_mm[m] += shape.displacements_mm[m];
    shape.covariances_mm2[m] = frame * estimator.covariances()[m] * frame.transpose();
  }
}

}  // namespace taclink
