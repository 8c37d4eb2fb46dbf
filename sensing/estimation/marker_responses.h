#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sensing/estimation/skin_stiffness.h"

namespace taclink {

/// J K^-1 by site: displacements of the stacked markers by unit loads on the five degrees of freedom of a
/// site's node, mm/N and mm/(N mm). Made for those sites only that are asked for. Not thread-safe.
class MarkerResponses {
 public:
  /// `jacobian`: J, referred to; only its values may change.
  MarkerResponses(const SkinMechanics& mechanics, const MarkerMap::Jacobian& jacobian);

  /// Forgets all of them, of another K or J.
  void Clear();
  /// Frees the memory of those that were asked for.
  void Drop();
  void Make(const SkinStiffness& stiffness, std::span<const int> sites);
  bool Has(int site) const { return place_[static_cast<size_t>(site)] >= 0; }
  /// 3 markers x 5. The site's must have been made.
  auto At(int site) const { return made_.middleCols<5>(5 * place_[static_cast<size_t>(site)]); }

  /// Loads of the degrees of freedom, by row.
  struct LoadRows {
    LoadRows(const SkinMechanics& mechanics, Eigen::Index count);
    /// Row `row` is not zero at that degree of freedom's row of nodes.
    void Fill(Eigen::Index row, int dof);
    Eigen::MatrixXf loads;
    std::vector<BlockTridiagonal::Rows> filled;  // see SkinStiffness::SolveRows
    Eigen::Index row_dofs = 0;
  };
  /// Displacements by these loads: J K^-1 loads', one column per row of loads.
  Eigen::MatrixXf Of(const SkinStiffness& stiffness, LoadRows rows) const;

 private:
  void MakeFromMarkers(const SkinStiffness& stiffness, const std::vector<int>& missing);
  void MakeFromNodes(const SkinStiffness& stiffness, const std::vector<int>& missing);
  void MakeRotated(const SkinStiffness& stiffness, const std::vector<int>& missing);
  void MakeFirst(const SkinStiffness& stiffness);

  const SkinMechanics& mechanics_;
  const MarkerMap::Jacobian& jacobian_;
  std::vector<BlockTridiagonal::Rows> filled_;  // rows of J that are not zero at that row of nodes
  Eigen::MatrixXf made_;                        // 3 markers x 5 per site in place_
  std::vector<Eigen::Index> place_;             // by site, in made_; -1: not made
  Eigen::MatrixXf first_;  // of a skin of revolution: likewise, of the sites from the first path to the next
};

}  // namespace taclink
