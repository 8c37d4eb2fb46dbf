#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sensing/shell/equilibrium.h"
#include "sensing/shell/nonlinear_shell.h"

namespace taclink::benchmark {

struct SurfacePoint {
  Vec3 mid;
  Vec3 director;
};

/// A ShellSurface put together from mapped patches, and its supports. Units are the benchmark's own.
class SurfaceMesh {
 public:
  using Map = std::function<SurfacePoint(double u, double v)>;

  explicit SurfaceMesh(double thickness) { surface_.thickness_mm = thickness; }

  /// columns x rows quadrilaterals over u, v in [0, 1], directors along d/du x d/dv. Shares the nodes that
  /// are already there.
  void AddPatch(int columns, int rows, const Map& map);

  std::vector<int> NodesWhere(const std::function<bool(const Vec3&)>& where) const;
  /// The node at a point; aborts where there is none.
  int NodeAt(const Vec3& point) const;

  void Fix(const std::vector<int>& nodes, std::initializer_list<size_t> components);
  /// Rotations 3 and 4 are then about `tangent` and about director x tangent.
  void SetTangent(const std::vector<int>& nodes, const Vec3& tangent);
  /// Mirror plane: no motion along the axis, no rotation but about it.
  void FixMirror(int axis, double position);

  const ShellSurface& surface() const { return surface_; }

 private:
  ShellSurface surface_;
};

/// Piece of a round cylinder about z: u from angle `from` to `to` (rad, from x towards y), v from z 0 to
/// length.
SurfaceMesh::Map CylinderMap(double radius, double from, double to, double length);
/// Piece of a sphere: u along the equator from 0 to 90 degrees, v from the equator to `to_latitude` (rad).
SurfaceMesh::Map SphereMap(double radius, double to_latitude);
/// Octant of a sphere, three patches of n x n around its middle.
void AddOctant(double radius, int n, SurfaceMesh& mesh);

/// A load by degree of freedom.
class NodalLoads {
 public:
  explicit NodalLoads(const NonlinearShell& shell)
      : shell_(shell), values_(Eigen::VectorXd::Zero(shell.dof_count())) {}
  /// On a node's component (0..4); nothing where it stands still.
  void Add(int node, int component, double value);
  void Add(int node, const Vec3& force);
  /// Dead load per area of the undeformed mid-surface.
  void AddPerArea(const Vec3& force);
  /// Dead load per length on an edge, whose nodes are given in order.
  void AddPerLength(const std::vector<int>& nodes, const Vec3& force);

  const Eigen::VectorXd& values() const { return values_; }

 private:
  const NonlinearShell& shell_;
  Eigen::VectorXd values_;
};

/// Increments of the degrees of freedom that a small load makes at a state: one Newton step.
Eigen::VectorXd TangentResponse(const NonlinearShell& shell, const ShellState& state,
                                NonlinearShell::Loads loads, const Eigen::VectorXd& load);

/// A row of the table in docs/reports/shell-benchmarks.md, on stdout: for meshes that are too coarse to
/// expect anything of.
void Tabulate(const std::string& benchmark, const std::string& mesh, double published, double computed);
/// The same, and an expectation: computed / published is 1 to within `share`.
void Compare(const std::string& benchmark, const std::string& mesh, double published, double computed,
             double share);

struct LoadPath {
  std::vector<double> shares;  ///< of the whole load, one after the other
  EquilibriumOptions options;
  /// Thin shells need several times fewer iterations without it.
  bool line_search = true;
  bool stable = true;  ///< expected: every equilibrium is a minimum of the energy
};

/// Raises a dead load to each share of it in turn and calls `at` with the share and the equilibrium; a share
/// that doesn't converge fails the test and ends it.
void FollowLoad(const NonlinearShell& shell, const Eigen::VectorXd& load, const LoadPath& path,
                const std::function<void(double, const ShellState&)>& at);

/// Moves one component of one node to each value in turn and calls `at` with the value and the force on it
/// that holds it there.
void FollowDisplacement(const ShellSurface& surface, const Material& material, int node, int axis,
                        const std::vector<double>& values, const EquilibriumOptions& options,
                        const std::function<void(double, double)>& at);

std::string MeshName(int columns, int rows);

/// count shares, the last one 1.
std::vector<double> EvenShares(int count);

}  // namespace taclink::benchmark
