#include "sensing/force/skin_tangent.h"

#include "sensing/mechanics/linear_shell.h"

namespace taclink {
namespace {

double MarkerOffset(const LinkModel& model) {
  return model.thickness_mm / 2 - model.markers.center_depth_mm;
}

}  // namespace

std::vector<UnitForce> UnitForces(const LoadSites& sites) {
  std::vector<UnitForce> forces;
  for (int row = 0; row < sites.rows; ++row) {
    for (int first = 0; first < sites.columns_per_path; ++first) {
      for (int direction = 0; direction < 3; ++direction) {
        forces.push_back({row * sites.columns + first, direction});
      }
    }
  }
  return forces;
}

void SizeColumns(const LinkModel& model, const LoadSites& sites, SkinTangent& tangent) {
  for (auto* matrix : {&tangent.inward_mm_n, &tangent.around_mm_n, &tangent.along_mm_n}) {
    matrix->resize(3 * model.markers.count(), sites.count());
  }
}

void FillColumns(const LinkModel& model, const LoadSites& sites, const UnitForce& force,
                 const Eigen::VectorXd& answer_mm, SkinTangent& tangent) {
  const int markers = model.markers.count(), paths = model.markers.paths;
  auto& matrix = force.direction == 0   ? tangent.inward_mm_n
                 : force.direction == 1 ? tangent.around_mm_n
                                        : tangent.along_mm_n;
  for (int path = 0; path < paths; ++path) {
    const Mat3 turn =
        Eigen::AngleAxisd(path * model.markers.path_pitch_rad(), Vec3::UnitZ()).toRotationMatrix();
    const int column = force.site + path * sites.columns_per_path;
    for (int m = 0; m < markers; ++m) {
      const int to = model.MarkerIndex((model.PathOf(m) + path) % paths, model.RingOf(m));
      matrix.col(column).segment<3>(3 * to) = (turn * answer_mm.segment<3>(3 * m)).cast<float>();
    }
  }
}

void MarkerMotions(const LinkModel& model, const ShellMesh& mesh, const NonlinearShell& shell,
                   const ShellState& state, const Eigen::VectorXd& step, Eigen::VectorXd& stacked_mm) {
  const double offset = MarkerOffset(model);
  stacked_mm.resize(3 * model.markers.count());
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    const auto i = static_cast<size_t>(node);
    const Vec3& d = state.directors[i];
    const Vec3& t = state.tangents[i];
    const Eigen::Index at = shell.Dof(node, 0);  // a marker's node is free
    const Vec3 turn = step[at + 3] * t + step[at + 4] * d.cross(t);
    stacked_mm.segment<3>(3 * m) = step.segment<3>(at) + offset * turn.cross(d);
  }
}

void MarkerDisplacements(const LinkModel& model, const ShellMesh& mesh, const ShellState& state,
                         Eigen::VectorXd& stacked_mm) {
  const double offset = MarkerOffset(model);
  stacked_mm.resize(3 * model.markers.count());
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    const auto i = static_cast<size_t>(node);
    stacked_mm.segment<3>(3 * m) = state.AtOffset(node, offset) - mesh.mid_mm[i] - offset * mesh.normals[i];
  }
}

SkinTangent LinearTangent(const LinkModel& model, int refinement, const LoadSites& sites) {
  const LinearShell shell(model, refinement);
  const double offset = MarkerOffset(model);
  const auto stacked = [&](const ShellDisplacement& u) {
    Eigen::VectorXd all(3 * model.markers.count());
    for (int m = 0; m < model.markers.count(); ++m) {
      all.segment<3>(3 * m) = u.AtOffset(shell.mesh(), shell.mesh().NodeOfMarker(model, m), offset);
    }
    return all;
  };
  SkinTangent tangent;
  tangent.per_pressure = stacked(shell.PerPressure());
  tangent.offset_mm = Eigen::VectorXd::Zero(tangent.per_pressure.size());
  SizeColumns(model, sites, tangent);
  for (const UnitForce& force : UnitForces(sites)) {
    const auto site = static_cast<size_t>(force.site);
    std::vector<NodalLoad> loads;
    for (const auto& [node, share] : sites.spreads[site]) {
      loads.push_back({node, share * sites.frames[site].col(force.direction)});
    }
    FillColumns(model, sites, force, stacked(shell.Solve(loads)), tangent);
  }
  return tangent;
}

}  // namespace taclink
