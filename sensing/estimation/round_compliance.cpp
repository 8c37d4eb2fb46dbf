#include "sensing/estimation/round_compliance.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <utility>

namespace taclink {

RoundCompliance::RoundCompliance(const SkinMechanics& mechanics, std::shared_ptr<const InflatedSkin> skin)
    : mechanics_(mechanics),
      skin_(std::move(skin)),
      parts_(mechanics.mesh().refinement),
      paths_(mechanics.columns() / parts_),
      jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())) {
  mechanics.markers().WriteJacobian(mechanics.shell(), skin_->state, jacobian_);
}

// Row by row of sites. K^-1 J' of the markers of one path gives how these respond to loads at all sites; what
// a load does to another path is that, turned.
void RoundCompliance::MakeResponses() const {
  const int around = mechanics_.columns();
  const Eigen::Index sites = parts_ * mechanics_.site_rows(), rings = jacobian_.rows() / (3 * paths_);
  responses_.resize(jacobian_.rows(), kNodeDofs * sites);
  std::array<Eigen::VectorXd, 3> pulled;
  for (Eigen::Index ring = 0; ring < rings; ++ring) {
    for (Eigen::Index c = 0; c < 3; ++c)
      Solve(jacobian_.row(3 * ring * paths_ + c).transpose(), pulled[static_cast<size_t>(c)]);
    for (int path = 0; path < paths_; ++path) {
      Mat3 turn = Mat3::Identity();
      turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(2 * kPi * path / paths_).toRotationMatrix();
      for (Eigen::Index i = 0; i < sites; ++i) {
        const int row = static_cast<int>(i) / parts_, column = static_cast<int>(i) % parts_ - path * parts_;
        const int site = row * around + (column + around) % around;
        Eigen::Matrix<double, 3, kNodeDofs> response;
        for (Eigen::Index c = 0; c < 3; ++c)
          response.row(c) = pulled[static_cast<size_t>(c)].segment<kNodeDofs>(kNodeDofs * site).transpose();
        response = (turn * response).eval();
        response.leftCols<3>() = (response.leftCols<3>() * turn.transpose()).eval();
        responses_.block<3, kNodeDofs>(3 * (ring * paths_ + path), kNodeDofs * i) = response.cast<float>();
      }
    }
  }
}

// Adds the stacked displacements `from`, rotated about the axis by `by` paths, to `to`.
void RoundCompliance::AddTurned(const float* from, int by, float* to) const {
  const double angle = 2 * kPi * by / paths_;
  const auto c = static_cast<float>(std::cos(angle)), s = static_cast<float>(std::sin(angle));
  const Eigen::Index rings = jacobian_.rows() / (3 * paths_);
  for (Eigen::Index ring = 0; ring < rings; ++ring) {
    for (int path = 0; path < paths_; ++path, to += 3) {
      const float* v = from + 3 * (ring * paths_ + (path < by ? path - by + paths_ : path - by));
      to[0] += c * v[0] - s * v[1];
      to[1] += s * v[0] + c * v[1];
      to[2] += v[2];
    }
  }
}

// Of all cases at once: the responses of a site are read once.
void RoundCompliance::AddDisplacements(int site, const LoadCases::OnSite& on,
                                       Eigen::MatrixXf& displacements) const {
  const int row = site / mechanics_.columns(), around = site % mechanics_.columns(), by = around / parts_;
  const Eigen::Rotation2Df back(static_cast<float>(-2 * kPi * by / paths_));
  Eigen::Matrix<float, kNodeDofs, Eigen::Dynamic> turned = on.loads;
  turned.topRows<2>() = (back.toRotationMatrix() * turned.topRows<2>()).eval();
  thread_local Eigen::MatrixXf first;
  first = responses_.middleCols<kNodeDofs>(kNodeDofs * (row * parts_ + around % parts_)).lazyProduct(turned);
  for (Eigen::Index k = 0; k < first.cols(); ++k)
    AddTurned(first.col(k).data(), by, displacements.col(on.cases[static_cast<size_t>(k)]).data());
}

void RoundCompliance::AddResponses(int site, Eigen::Ref<Eigen::MatrixXf> responses) const {
  if (responses_.size() == 0) MakeResponses();
  const int row = site / mechanics_.columns(), around = site % mechanics_.columns(), by = around / parts_;
  const Vec2 radial = mechanics_.RestSite(around % parts_).head<2>().normalized();
  const auto c = static_cast<float>(radial.x()), s = static_cast<float>(radial.y());
  thread_local Eigen::MatrixXf first;
  first = responses_.middleCols<kNodeDofs>(kNodeDofs * (row * parts_ + around % parts_));
  const Eigen::VectorXf along_x = first.col(0);
  first.col(0) = c * along_x + s * first.col(1);
  first.col(1) = c * first.col(1) - s * along_x;
  for (Eigen::Index k = 0; k < kNodeDofs; ++k) AddTurned(first.col(k).data(), by, responses.col(k).data());
}

Eigen::MatrixXf RoundCompliance::Displacements(const LoadCases& cases) const {
  Eigen::MatrixXf displacements = Eigen::MatrixXf::Zero(jacobian_.rows(), cases.count());
  if (responses_.size() == 0) MakeResponses();
  for (const auto& [site, on] : cases.BySite(kFewLoads)) AddDisplacements(site, on, displacements);
  Eigen::VectorXd forces, motion;
  for (Eigen::Index i = 0; i < cases.count(); ++i) {
    if (cases[i].size() <= kFewLoads) continue;
    forces.setZero(jacobian_.cols());
    for (const auto& [site, load] : cases[i]) forces.segment<kNodeDofs>(kNodeDofs * site) += load;
    Solve(forces, motion);
    displacements.col(i) = (jacobian_ * motion).cast<float>();
  }
  return displacements;
}

RoundCompliance::NodeBlock RoundCompliance::BlockOf(int moved_site, int loaded_site) const {
  if (inverse_.size() == 0) inverse_ = skin_->stiffness.Inverse();
  const int around = mechanics_.columns(), rows = mechanics_.site_rows();
  const int difference = (moved_site - loaded_site + around * rows) % around;
  const bool is_mirrored = 2 * difference > around;
  const Eigen::Index block = is_mirrored ? around - difference : difference;
  NodeBlock found = inverse_.block<kNodeDofs, kNodeDofs>(kNodeDofs * (block * rows + moved_site / around),
                                                         kNodeDofs * (loaded_site / around));
  if (is_mirrored) {
    for (Eigen::Index i = 0; i < kNodeDofs; ++i) {
      for (Eigen::Index j = 0; j < kNodeDofs; ++j) {
        if (RingBlocks::IsOdd(i) != RingBlocks::IsOdd(j)) found(i, j) = -found(i, j);
      }
    }
  }
  return found;
}

}  // namespace taclink
