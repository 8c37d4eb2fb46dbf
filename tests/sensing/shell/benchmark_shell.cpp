#include "benchmark_shell.h"

#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "sensing/shell/shape_functions.h"

namespace taclink::benchmark {
namespace {

constexpr double kSame = 1e-6;  // of the benchmarks' lengths, 1 and more

}  // namespace

void SurfaceMesh::AddPatch(int columns, int rows, const Map& map) {
  std::vector<int> nodes;
  const size_t known = surface_.mids_mm.size();
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      const auto [mid, director] = map(static_cast<double>(i) / columns, static_cast<double>(j) / rows);
      int node = -1;
      for (size_t k = 0; k < known && node < 0; ++k) {
        if ((surface_.mids_mm[k] - mid).norm() < kSame) node = static_cast<int>(k);
      }
      if (node < 0) {
        node = static_cast<int>(surface_.mids_mm.size());
        surface_.mids_mm.push_back(mid);
        surface_.directors.push_back(director.normalized());
        surface_.tangents.push_back(director.unitOrthogonal());
        surface_.fixed.push_back({});
      }
      nodes.push_back(node);
    }
  }
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const auto at = [&](int a, int b) { return nodes[static_cast<size_t>(b * (columns + 1) + a)]; };
      surface_.elements.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
}

std::vector<int> SurfaceMesh::NodesWhere(const std::function<bool(const Vec3&)>& where) const {
  std::vector<int> nodes;
  for (size_t i = 0; i < surface_.mids_mm.size(); ++i) {
    if (where(surface_.mids_mm[i])) nodes.push_back(static_cast<int>(i));
  }
  return nodes;
}

int SurfaceMesh::NodeAt(const Vec3& point) const {
  const auto nodes = NodesWhere([&](const Vec3& p) { return (p - point).norm() < kSame; });
  if (nodes.size() != 1) std::abort();
  return nodes[0];
}

void SurfaceMesh::Fix(const std::vector<int>& nodes, std::initializer_list<size_t> components) {
  for (const int node : nodes) {
    for (const size_t c : components) surface_.fixed[static_cast<size_t>(node)][c] = true;
  }
}

void SurfaceMesh::SetTangent(const std::vector<int>& nodes, const Vec3& tangent) {
  for (const int node : nodes) {
    const Vec3& d = surface_.directors[static_cast<size_t>(node)];
    surface_.tangents[static_cast<size_t>(node)] = (tangent - tangent.dot(d) * d).normalized();
  }
}

void SurfaceMesh::FixMirror(int axis, double position) {
  const auto nodes = NodesWhere([&](const Vec3& p) { return std::abs(p[axis] - position) < kSame; });
  for (const int node : nodes) {
    const bool second = surface_.fixed[static_cast<size_t>(node)][4];
    if (!second) SetTangent({node}, Vec3::Unit(axis));
    Fix({node}, {static_cast<size_t>(axis), second ? size_t{3} : size_t{4}});
  }
}

SurfaceMesh::Map CylinderMap(double radius, double from, double to, double length) {
  return [=](double u, double v) {
    const double angle = from + u * (to - from);
    const Vec3 out(std::cos(angle), std::sin(angle), 0);
    return SurfacePoint{radius * out + Vec3(0, 0, v * length), out};
  };
}

SurfaceMesh::Map SphereMap(double radius, double to_latitude) {
  return [=](double u, double v) {
    const double longitude = u * kPi / 2, latitude = v * to_latitude;
    const Vec3 out(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                   std::sin(latitude));
    return SurfacePoint{radius * out, out};
  };
}

void AddOctant(double radius, int n, SurfaceMesh& mesh) {
  for (int corner = 0; corner < 3; ++corner) {
    const Vec3 a = Vec3::Unit(corner), b = Vec3::Unit((corner + 1) % 3), c = Vec3::Unit((corner + 2) % 3);
    const Vec3 ab = (a + b).normalized(), ac = (a + c).normalized(), middle = (a + b + c).normalized();
    mesh.AddPatch(n, n, [=](double u, double v) {
      const Vec3 p = (1 - u) * (1 - v) * a + u * (1 - v) * ab + u * v * middle + (1 - u) * v * ac;
      return SurfacePoint{radius * p.normalized(), p.normalized()};
    });
  }
}

void NodalLoads::Add(int node, int component, double value) {
  if (const int dof = shell_.Dof(node, component); dof >= 0) values_[dof] += value;
}

void NodalLoads::Add(int node, const Vec3& force) {
  for (int c = 0; c < 3; ++c) Add(node, c, force[c]);
}

void NodalLoads::AddPerArea(const Vec3& force) {
  const ShellSurface& surface = shell_.surface();
  for (const auto& element : surface.elements) {
    Eigen::Matrix<double, 3, 4> corners;
    for (size_t i = 0; i < 4; ++i) {
      corners.col(static_cast<Eigen::Index>(i)) = surface.mids_mm[static_cast<size_t>(element[i])];
    }
    for (const double xi : {-kGauss, kGauss}) {
      for (const double eta : {-kGauss, kGauss}) {
        const ShapeFunctions n = ShapeFunctionsAt(xi, eta);
        const Vec3 along_xi = corners * n.by_xi, along_eta = corners * n.by_eta;
        const double area = along_xi.cross(along_eta).norm();
        for (size_t i = 0; i < 4; ++i) Add(element[i], n.value[static_cast<Eigen::Index>(i)] * area * force);
      }
    }
  }
}

void NodalLoads::AddPerLength(const std::vector<int>& nodes, const Vec3& force) {
  for (size_t i = 0; i + 1 < nodes.size(); ++i) {
    const auto& mids = shell_.surface().mids_mm;
    const Vec3 half =
        0.5 * force * (mids[static_cast<size_t>(nodes[i + 1])] - mids[static_cast<size_t>(nodes[i])]).norm();
    Add(nodes[i], half);
    Add(nodes[i + 1], half);
  }
}

Eigen::VectorXd TangentResponse(const NonlinearShell& shell, const ShellState& state,
                                NonlinearShell::Loads loads, const Eigen::VectorXd& load) {
  auto hessian = shell.Pattern();
  Eigen::VectorXd gradient;
  shell.Hessian(state, loads, gradient, hessian);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(hessian);
  EXPECT_EQ(factor.info(), Eigen::Success);
  return factor.solve(load);
}

void Tabulate(const std::string& benchmark, const std::string& mesh, double published, double computed) {
  std::printf("| %s | %s | %.5g | %.5g | %.4f |\n", benchmark.c_str(), mesh.c_str(), published, computed,
              computed / published);
}

void Compare(const std::string& benchmark, const std::string& mesh, double published, double computed,
             double share) {
  Tabulate(benchmark, mesh, published, computed);
  EXPECT_NEAR(computed / published, 1, share) << benchmark << ", " << mesh;
}

void FollowLoad(const NonlinearShell& shell, const Eigen::VectorXd& load, const LoadPath& path,
                const std::function<void(double, const ShellState&)>& at) {
  EquilibriumSolver solver(shell, path.options);
  ShellState state = shell.Rest();
  for (const double share : path.shares) {
    const EquilibriumSummary summary = solver.Solve({}, share * load, state, path.line_search);
    ASSERT_TRUE(summary.ok()) << Name(summary.stop) << " at " << share << " of the load, residual "
                              << summary.residual_n;
    if (path.stable) {
      EXPECT_TRUE(summary.stable) << "at " << share << " of the load";
    }
    at(share, state);
  }
}

void FollowDisplacement(const ShellSurface& surface, const Material& material, int node, int axis,
                        const std::vector<double>& values, const EquilibriumOptions& options,
                        const std::function<void(double, double)>& at) {
  const auto i = static_cast<size_t>(node), c = static_cast<size_t>(axis);
  ShellSurface held = surface;
  held.fixed[i][c] = true;
  const NonlinearShell free_shell(surface, material), held_shell(held, material);
  EquilibriumSolver solver(held_shell, options);
  ShellState state = held_shell.Rest();
  for (const double value : values) {
    state.mids_mm[i][axis] = surface.mids_mm[i][axis] + value;
    const EquilibriumSummary summary = solver.Solve({}, {}, state, false);
    ASSERT_TRUE(summary.ok()) << Name(summary.stop) << " at " << value;
    Eigen::VectorXd gradient;
    free_shell.Gradient(state, {}, gradient);
    at(value, gradient[free_shell.Dof(node, axis)]);
  }
}

std::string MeshName(int columns, int rows) {
  return std::to_string(columns) + " x " + std::to_string(rows);
}

std::vector<double> EvenShares(int count) {
  std::vector<double> shares;
  for (int i = 1; i <= count; ++i) shares.push_back(static_cast<double>(i) / count);
  return shares;
}

}  // namespace taclink::benchmark
