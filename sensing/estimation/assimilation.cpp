#include "sensing/estimation/assimilation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "sensing/estimation/unseen_markers.h"

namespace taclink {
namespace {

constexpr double kSpringNMm = 3;    // of a marker that is seen well; times E t
constexpr double kWorthMm = 0.3;    // an observation as uncertain as this has half of it
constexpr double kSettledMm = 0.2;  // it is a place to linearize at
constexpr int kMostEvaluations = 24;
constexpr double kLongestStepMm = 50, kMostTurn = 1;  // the line search does without

EnergySearchOptions SearchOptions(const SkinMechanics& mechanics) {
  return {.tolerance_mm = kSettledMm * mechanics.length_unit(),
          .most_evaluations = kMostEvaluations,
          .longest_step_mm = kLongestStepMm * mechanics.length_unit(),
          .most_turn_rad = kMostTurn};
}

double SpringOf(const LinkModel& model) {
  return kSpringNMm * model.material.youngs_modulus_mpa * model.thickness_mm / (0.1 * 3.5);
}

}  // namespace

Assimilation::Assimilation(const SkinMechanics& mechanics)
    : mechanics_(mechanics),
      spring_n_mm_(SpringOf(mechanics.model())),
      search_(mechanics.shell(), SearchOptions(mechanics)),
      stiffness_(mechanics.shell()),
      springs_(static_cast<size_t>(mechanics.marker_count())) {}

// A direction's spring is as stiff as it is known; one camera leaves one direction free.
void Assimilation::SetSprings(const MarkerObservations& observed) {
  const double worth_mm = kWorthMm * mechanics_.length_unit();
  for (size_t m = 0; m < springs_.size(); ++m) {
    if (observed.information[m].isZero()) {
      springs_[m].setZero();
      continue;
    }
    Eigen::SelfAdjointEigenSolver<Mat3> modes;
    modes.computeDirect(observed.information[m]);
    Vec3 known = modes.eigenvalues().cwiseMax(0) * worth_mm * worth_mm;
    known = spring_n_mm_ * known.cwiseQuotient(known + Vec3::Ones());
    springs_[m] = modes.eigenvectors() * known.asDiagonal() * modes.eigenvectors().transpose();
  }
}

// Of the inflated skin with a spring at every marker; where there are more columns of nodes than paths of
// markers, each column has its share.
bool Assimilation::Factorize(const InflatedSkin& skin) {
  const NonlinearShell& shell = mechanics_.shell();
  const MarkerMap& map = mechanics_.markers();
  const PressureLoads pressure(skin.pressure_mpa);
  RingBlocks blocks;
  Eigen::VectorXd gradient;
  blocks.Set(shell, skin.state, pressure.loads(), gradient);
  const int columns = mechanics_.columns(), paths = mechanics_.model().markers.paths;
  for (int first = 0; first < map.markers(); first += paths) {
    const int node = map.node(first);
    const Eigen::Matrix<double, 3, kNodeDofs> own = map.OwnJacobian(skin.state, first);
    const Vec2 radial = shell.surface().mids_mm[static_cast<size_t>(node)].head<2>().normalized();
    Eigen::Matrix<double, kNodeDofs, kNodeDofs> turn =
        Eigen::Matrix<double, kNodeDofs, kNodeDofs>::Identity();
    turn.topLeftCorner<2, 2>() << radial.x(), radial.y(), -radial.y(), radial.x();
    blocks.own.block<kNodeDofs, kNodeDofs>(kNodeDofs * (node / columns - 1), kNodeDofs) +=
        spring_n_mm_ * paths / columns * turn * own.transpose() * own * turn.transpose();
  }
  return stiffness_.Factorize(blocks);
}

double Assimilation::Value(const MarkerObservations& observed, const KnownLoads& known,
                           const ShellState& state, Eigen::VectorXd& gradient) {
  const MarkerMap& map = mechanics_.markers();
  double value = mechanics_.Gradient(state, known, gradient);
  map.Displacements(state, markers_mm_);
  for (int m = 0; m < map.markers(); ++m) {
    const auto i = static_cast<size_t>(m);
    if (springs_[i].isZero()) continue;
    const Vec3 off = markers_mm_.segment<3>(3 * m) - observed.displacement_mm[i], pull = springs_[i] * off;
    value += 0.5 * off.dot(pull);
    // The wall's thickness is held: its derivative would couple nodes that the shell's pattern does not.
    gradient.segment<kNodeDofs>(mechanics_.shell().Dof(map.node(m), 0)) +=
        map.OwnJacobian(state, m).transpose() * pull;
  }
  return value;
}

Assimilation::Summary Assimilation::Run(const MarkerObservations& observed, const UntouchedSkin& untouched,
                                        ShellState& state, Eigen::VectorXd& pulls_n) {
  MarkerObservations filled = observed;
  InterpolateUnseen(mechanics_.model(), untouched.markers_mm, mechanics_.length_unit(), filled);
  SetSprings(filled);
  Summary summary;
  if (factored_ != untouched.weightless)
    factored_ = Factorize(*untouched.weightless) ? untouched.weightless : nullptr;
  if (factored_)
    summary = search_.Minimize(
        [&](const ShellState& at, Eigen::VectorXd& gradient) {
          return Value(filled, untouched.loads, at, gradient);
        },
        [&](const Eigen::VectorXd& forces, Eigen::VectorXd& motion) { stiffness_.Solve(forces, motion); },
        state);
  mechanics_.markers().Displacements(state, markers_mm_);
  pulls_n.setZero(markers_mm_.size());
  for (size_t m = 0; m < springs_.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    if (!observed.information[m].isZero())
      pulls_n.segment<3>(at) = springs_[m] * (observed.displacement_mm[m] - markers_mm_.segment<3>(at));
  }
  return summary;
}

}  // namespace taclink
