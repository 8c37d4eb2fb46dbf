#include "sensing/estimation/linearization.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "sensing/estimation/site_columns.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/equilibrium.h"

namespace taclink {
namespace {

constexpr std::array kDirections = {Linearization::kInward, Linearization::kAround, Linearization::kAlong};

class LinearizationTest : public ::testing::TestWithParam<const char*> {
 protected:
  LinearizationTest() : mechanics_(LoadLinkModel(GetParam()).value()) {}

  // Each direction at each of some sites, a couple, and loads on a few of them and on half of the skin.
  LoadCases Cases(const Linearization& skin) const {
    LoadCases cases;
    for (const int site : {0, 7, 130, mechanics_.site_count() / 2, mechanics_.site_count() - 1}) {
      for (const auto direction : kDirections) {
        cases.Begin();
        cases.Add(site, skin.ForceAt(direction, site));
      }
      cases.Begin();
      cases.Add(site, skin.CoupleAt(Linearization::kAlong, site));
    }
    for (const int end : {40, mechanics_.site_count()}) {
      cases.Begin();
      for (int site = 0; site < end; site += 2) cases.Add(site, skin.ForceAt(Linearization::kAround, site));
    }
    return cases;
  }
  // The largest difference of a column, by its norm.
  static double Difference(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b) {
    return ((a - b).colwise().norm().array() / b.colwise().norm().array()).maxCoeff();
  }
  // Pressed inward at one site's node and its neighbors until that has moved by `depth_mm`; another place at
  // a shallower depth.
  ShellState Dented(const UntouchedSkin& untouched, double depth_mm) const {
    EquilibriumSolver solver(mechanics_.shell(), {});
    const PressureLoads pressure(untouched.loads.pressure_mpa);
    const int site = mechanics_.site_count() / 2;
    const auto node = static_cast<size_t>(mechanics_.NodeOfSite(site));
    ShellState state = untouched.state;
    Eigen::VectorXd force = Eigen::VectorXd::Zero(mechanics_.shell().dof_count());
    for (Eigen::SparseMatrix<double>::InnerIterator it(mechanics_.spread(), site); it; ++it)
      force.segment<3>(kNodeDofs * static_cast<int>(it.row())) -=
          it.value() * mechanics_.mesh().normals[node];
    for (double n = 0.02 * mechanics_.force_unit();
         (state.mids_mm[node] - untouched.state.mids_mm[node]).norm() < depth_mm; n *= 1.3)
      EXPECT_TRUE(solver.Solve(pressure.loads(), n * force, state).ok());
    return state;
  }

  SkinMechanics mechanics_;
};

// With the stiffness by harmonics and turned columns it is what it is with the block factor.
TEST_P(LinearizationTest, AnInflatedSkinsIsThatOfItsState) {
  Linearization general(mechanics_), round(mechanics_);
  const UntouchedSkin* skin = mechanics_.Untouched({.pressure_mpa = 1e-3, .specific_force_mps2 = {3, -4, 5}});
  ASSERT_TRUE(skin != nullptr && skin->inflated() != nullptr);
  const ShellState& inflated = skin->inflated()->state;
  ASSERT_GT((skin->state.mids_mm[300] - inflated.mids_mm[300]).norm(), 0.2) << "it sags";
  const KnownLoads at{skin->inflated()->pressure_mpa, {1, -2, 0.5}};
  ASSERT_TRUE(general.At(inflated, at));
  ASSERT_TRUE(round.At(skin->inflated(), at));
  EXPECT_TRUE(round.is_of_revolution());
  EXPECT_FALSE(general.is_of_revolution());
  EXPECT_LT((round.base_mm() - general.base_mm()).norm(), 1e-5 * general.base_mm().norm());
  EXPECT_LT((round.by_known_loads() - general.by_known_loads()).norm(),
            1e-5 * general.by_known_loads().norm());
  EXPECT_LT(Difference(round.Displacements(Cases(round)), general.Displacements(Cases(general))), 1e-4);
  // And from the state that sags.
  ASSERT_TRUE(round.Rebase(skin->state, skin->loads));
  EXPECT_LT((round.base_mm() - skin->markers_mm).norm(), 1e-3 * skin->markers_mm.norm());
}

// A patch of all sites is the whole skin; one of the 37 sites that have changed most comes near to that. What
// a load does and where a state's base is go by the same inverse.
TEST_P(LinearizationTest, APatchComesNearToTheWholeSkin) {
  const double unit = mechanics_.length_unit();
  const UntouchedSkin untouched = *mechanics_.Untouched({.pressure_mpa = 8 * mechanics_.pressure_step()});
  ASSERT_TRUE(untouched.inflated() != nullptr);
  const ShellState state = Dented(untouched, 5 * unit);
  Linearization round(mechanics_), whole(mechanics_), patch(mechanics_);
  ASSERT_TRUE(round.At(untouched.inflated(), untouched.loads));
  ASSERT_TRUE(whole.At(state, untouched.loads));
  const LoadCases cases = Cases(whole);
  const Eigen::MatrixXf expected = whole.Displacements(cases);
  std::vector<int> all(static_cast<size_t>(mechanics_.site_count()));
  std::iota(all.begin(), all.end(), 0);
  ASSERT_TRUE(patch.At(state, untouched.loads, round.round(), all));
  EXPECT_LT(Difference(patch.Displacements(cases), expected), 2e-3);
  EXPECT_LT((patch.base_mm() - whole.base_mm()).cwiseAbs().maxCoeff(), 5e-3 * unit);
  const StatePatch most = PatchBetween(mechanics_, untouched.inflated()->state, state, 37);
  EXPECT_EQ(most.sites.size(), 37U);
  EXPECT_TRUE(std::ranges::is_sorted(most.sites));
  ASSERT_TRUE(patch.At(state, untouched.loads, round.round(), most.sites));
  const Eigen::MatrixXf near = patch.Displacements(cases);
  const double error = Difference(near, expected),
               without = Difference(round.Displacements(Cases(round)), expected);
  EXPECT_LT(error, 0.25);
  EXPECT_LT(error, 0.8 * without);
  // The same operator by one solution at a time.
  for (Eigen::Index i = 0; i < cases.count(); ++i) {
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(mechanics_.shell().dof_count()), motion;
    for (const auto& [site, load] : cases[i]) forces.segment<kNodeDofs>(kNodeDofs * site) += load;
    PatchCompliance alone(mechanics_);
    ASSERT_TRUE(alone.Set(round.round(), state, untouched.loads.pressure_mpa, most.sites));
    alone.Solve(forces, motion);
    const Eigen::VectorXf moved = (alone.jacobian() * motion).cast<float>();
    EXPECT_LT((moved - near.col(i)).norm(), 1e-3 * near.col(i).norm()) << i;
  }
}

TEST_P(LinearizationTest, ARingsColumnIsTheMeanOfItsSites) {
  Linearization skin(mechanics_);
  const UntouchedSkin* inflated = mechanics_.Untouched({.pressure_mpa = 5e-4});
  ASSERT_TRUE(inflated != nullptr);
  ASSERT_TRUE(skin.At(inflated->state, inflated->loads));
  const int around = mechanics_.columns(), sites = mechanics_.site_count();
  for (const int ring : {0, mechanics_.site_rows() / 2}) {
    std::vector<int> of_ring(static_cast<size_t>(around));
    std::iota(of_ring.begin(), of_ring.end(), ring * around);
    const Eigen::VectorXf expected = InwardColumns(mechanics_, skin, of_ring).rowwise().mean(),
                          band = InwardColumns(mechanics_, skin, std::array{sites + ring});
    EXPECT_LT((band - expected).norm(), 1e-3F * expected.norm()) << ring;
  }
}

INSTANTIATE_TEST_SUITE_P(Skins, LinearizationTest, ::testing::Values("cylinder", "barrel", "third"));

}  // namespace
}  // namespace taclink
