#include "sensing/shape/skin_basis.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sensing/mechanics/linear_shell.h"
#include "sensing/model/model_file.h"
#include "sensing/shape/field_scan.h"

namespace taclink {
namespace {

class SkinBasisTest : public testing::TestWithParam<std::string> {
 protected:
  const LinkModel model_ = LoadLinkModel(GetParam()).value();
};

TEST_P(SkinBasisTest, LoadsAreTheShellsAnswersTurnedToTheirPath) {
  const SkinBasis basis(model_);
  const LinearShell shell(model_, 2);
  const ShellMesh& mesh = shell.mesh();
  const int marker = model_.MarkerIndex(5, 3), node = mesh.NodeOfMarker(model_, marker);
  const Vec3 normal = mesh.normals[static_cast<size_t>(node)], around = basis.Frame(marker).col(1);
  const std::array<Vec3, 3> directions = {-normal, around, normal.cross(around)};
  Eigen::VectorXd column(3 * basis.markers());
  for (int a = 0; a < 3; ++a) {
    const NodalLoad load{node, directions[static_cast<size_t>(a)]};
    const ShellDisplacement u = shell.Solve({&load, 1});
    const int field = (3 * 3 + a) * basis.paths() + 5;
    ASSERT_EQ(basis.MarkerOf(field), marker);
    basis.WriteField(field, column);
    for (int m = 0; m < basis.markers(); ++m) {
      const Vec3 there = u.AtOffset(mesh, mesh.NodeOfMarker(model_, m),
                                    model_.thickness_mm / 2 - model_.markers.center_depth_mm);
      EXPECT_LT((basis.Frame(m) * column.segment<3>(3 * m) - there).norm(), 1e-8);
    }
  }
}

// All rings of the cylinder and all but the outer ones of the barrel have much the same area: the sum over
// loads is right to a few per cent for the cylinder only.
TEST(SkinBasisOfCylinder, ModesAndTheirRestAreTheCovarianceOfStrayLoads) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  SkinBasisOptions options;
  options.reference_area_mm2 = 1;  // cancels below
  const SkinBasis basis(model, options);
  const double area = 38.25 * model.markers.path_pitch_rad() * 18;
  const int marker = model.MarkerIndex(7, 4);
  Mat3 direct = Mat3::Zero();
  Eigen::VectorXd column(3 * basis.markers());
  for (int field = 0; field < 3 * basis.markers(); ++field) {
    basis.WriteField(field, column);
    const Vec3 u = column.segment<3>(3 * marker);
    direct += options.stray_load_n * options.stray_load_n * area * u * u.transpose();
  }
  const auto rows = basis.modes().middleRows<3>(3 * marker);
  const Mat3 from_modes = rows * rows.transpose() + basis.Remainder(marker);
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(from_modes(a, a) / direct(a, a), 1, 0.02);
}

TEST_P(SkinBasisTest, ScanIsTheProductWithEveryField) {
  const SkinBasis basis(model_);
  FieldScan scan(basis);
  const Eigen::VectorXd v = Eigen::VectorXd::Random(3 * basis.markers());
  Eigen::VectorXd correlations, column(3 * basis.markers());
  scan.Correlate(v, correlations);
  ASSERT_EQ(correlations.size(), basis.fields());
  for (int field = 0; field < basis.fields(); ++field) {
    basis.WriteField(field, column);
    EXPECT_NEAR(correlations[field], column.dot(v), basis.IsLoad(field) ? 1e-8 : 1e-2) << field;
    const int first = basis.OnFirstPath(field);
    EXPECT_TRUE(basis.IsWave(field) || basis.MarkerOf(first) % basis.paths() == 0);
    EXPECT_EQ(basis.MarkerOf(first) / basis.paths(), basis.MarkerOf(field) / basis.paths());
  }
}

TEST_P(SkinBasisTest, WavesAreSumsOfInwardLoads) {
  const SkinBasis basis(model_);
  Eigen::VectorXd column(3 * basis.markers()), sum(column.size());
  for (int wave = 0; wave < SkinBasis::kWaves; ++wave) {
    for (int ring = 0; ring < basis.wave_rings(); ++ring) {
      sum.setZero();
      for (int path = 0; path < basis.paths(); ++path) {
        const double angle = 2 * kPi * SkinBasis::HarmonicOf(wave) * path / basis.paths();
        basis.WriteField(basis.InwardColumn(ring) * basis.paths() + path, column);
        sum += (SkinBasis::IsSine(wave) ? std::sin(angle) : std::cos(angle)) * column;
      }
      const int field = basis.first_wave() + wave * basis.wave_rings() + ring;
      basis.WriteField(field, column);
      EXPECT_LT((column - sum).norm(), 1e-6 * sum.norm()) << wave << " " << ring;
      // Where the marker said to have most has most of its ring, but for the grid's steps.
      const int marker = basis.MarkerOf(field), first = marker / basis.paths() * basis.paths();
      double most = 0;
      for (int path = 0; path < basis.paths(); ++path)
        most = std::max(most, std::abs(column[3 * (first + path)]));
      EXPECT_GT(std::abs(column[3 * marker]), 0.9 * most);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, SkinBasisTest, testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
