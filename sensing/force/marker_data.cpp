#include "sensing/force/marker_data.h"

#include <Eigen/LU>

namespace taclink {

MarkerData::MarkerData(int markers, double noise_floor_mm)
    : measured_mm(Eigen::VectorXd::Zero(3 * markers)),
      residual_mm(Eigen::VectorXd::Zero(3 * markers)),
      information_per_mm2(static_cast<size_t>(markers), Mat3::Zero()),
      floor2_(noise_floor_mm * noise_floor_mm) {}

void MarkerData::Set(const SkinShape& shape, const Eigen::VectorXd& predicted_mm,
                     const Eigen::VectorXd& model_sigma_mm) {
  numbers = 0;
  for (size_t i = 0; i < information_per_mm2.size(); ++i) {
    const auto m = static_cast<Eigen::Index>(i);
    const MeasuredDisplacement& measured = shape.measured[i];
    auto u = measured_mm.segment<3>(3 * m);
    u = predicted_mm.segment<3>(3 * m);
    information_per_mm2[i].setZero();
    if (shape.sources[i] == MarkerSource::kInferred || !measured.displacement_mm.allFinite() ||
        !measured.information_per_mm2.allFinite()) {
      continue;
    }
    u = measured.displacement_mm;
    numbers += shape.sources[i] == MarkerSource::kBoth ? 3 : 2;
    // (information^-1 + variance)^-1; the information may be of rank 2.
    const double variance = floor2_ + model_sigma_mm[m] * model_sigma_mm[m];
    const Mat3 more = Mat3::Identity() + variance * measured.information_per_mm2;
    const Mat3 less = more.inverse() * measured.information_per_mm2;
    information_per_mm2[i] = 0.5 * (less + less.transpose());
  }
  residual_mm = measured_mm - predicted_mm;
}

void MarkerData::Weigh(const Eigen::Ref<const Eigen::VectorXd>& column,
                       Eigen::Ref<Eigen::VectorXd> weighed) const {
  for (size_t i = 0; i < information_per_mm2.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(3 * i);
    weighed.segment<3>(at).noalias() = information_per_mm2[i] * column.segment<3>(at);
  }
}

}  // namespace taclink
