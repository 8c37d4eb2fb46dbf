#include "sensing/estimation/ring_spectrum.h"

#include <cassert>
#include <cmath>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/dense.h"

namespace taclink {

RingSpectrum::RingSpectrum(const SkinMechanics& mechanics, int period)
    : paths_(mechanics.model().markers.paths),
      rings_(mechanics.model().markers.rings()),
      period_(period),
      groups_(paths_ / period),
      block_(3 * rings_ * period),
      outward_(2, paths_),
      basis_(groups_, groups_) {
  assert(paths_ % period == 0);
  for (int path = 0; path < paths_; ++path)
    outward_.col(path) = mechanics.RestMarker(path).head<2>().normalized().cast<float>();
  for (int k = 0; k < harmonics(); ++k) {
    const int column = k == 0 ? 0 : 2 * k - 1;
    const double scale = std::sqrt((IsReal(k) ? 1.0 : 2.0) / groups_);
    for (int g = 0; g < groups_; ++g) {
      basis_(g, column) = static_cast<float>(scale * std::cos(Angle(k, g)));
      if (!IsReal(k)) basis_(g, column + 1) = static_cast<float>(scale * std::sin(Angle(k, g)));
    }
  }
}

double RingSpectrum::Angle(int harmonic, int groups) const {
  return 2 * kPi * ((harmonic * groups) % groups_) / groups_;
}

Eigen::Matrix3f RingSpectrum::FrameOf(int marker) const {
  const auto outward = outward_.col(marker % paths_);
  Eigen::Matrix3f frame;
  frame << outward.x(), -outward.y(), 0, outward.y(), outward.x(), 0, 0, 0, 1;
  return frame;
}

void RingSpectrum::Transform(const Eigen::Ref<const Eigen::MatrixXf>& x, Eigen::MatrixXf& parts) const {
  Eigen::MatrixXf by_group(block_ * x.cols(), groups_);
  for (Eigen::Index column = 0; column < x.cols(); ++column) {
    const float* v = x.col(column).data();
    for (int marker = 0; marker < paths_ * rings_; ++marker, v += 3) {
      const auto outward = outward_.col(marker % paths_);
      float* to = &by_group(column * block_ + PlaceOf(marker), GroupOf(marker));
      to[0] = outward.x() * v[0] + outward.y() * v[1];
      to[1] = outward.x() * v[1] - outward.y() * v[0];
      to[2] = v[2];
    }
  }
  parts.resize(block_ * x.cols(), groups_);
  dense::SetProduct(1, by_group, basis_, parts);
}

Eigen::VectorXf RingSpectrum::TransformBack(const Eigen::MatrixXf& parts) const {
  assert(parts.rows() == block_);
  const Eigen::MatrixXf by_group = parts * basis_.transpose();
  Eigen::VectorXf x(block_ * groups_);
  for (int marker = 0; marker < paths_ * rings_; ++marker)
    x.segment<3>(3 * marker) = FrameOf(marker) * by_group.col(GroupOf(marker)).segment<3>(PlaceOf(marker));
  return x;
}

}  // namespace taclink
