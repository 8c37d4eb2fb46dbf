#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sensing/estimation/linearization.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// Groups loads into contacts: contacts are hills of the load, not islands. The loads are smoothed over the
/// sites and their watershed is taken [vincent1991]: two peaks are one contact if the saddle between them is
/// high, or if the skin between them lies below the chord of both, as under one plate; never if their forces
/// cancel each other, as on opposite sides. One thread.
class HillFinder {
 public:
  explicit HillFinder(const SkinMechanics& mechanics);

  using Hill = std::vector<int>;  ///< sites
  /// All of their sites, in order.
  static std::vector<int> AllOf(const std::vector<Hill>& hills);
  /// `loads_n`: inward, by site, of the sites in `support`, all above zero.
  std::vector<Hill> Find(const Linearization& skin, const Eigen::VectorXd& loads_n,
                         std::span<const int> support);

 private:
  void Smooth(const Eigen::VectorXd& loads_n, std::span<const int> support);
  void Flood(const Linearization& skin, const Eigen::VectorXd& loads_n);
  int Root(int basin) const;
  template <typename Visit>
  void ForNeighbors(int site, Visit visit) const;
  bool MayJoin(const Linearization& skin, const Eigen::VectorXd& loads_n, const Hill& a, const Hill& b,
               double& distance_mm) const;
  int PeakOf(const Hill& hill) const;
  struct Ridge {
    double bulge_mm = 0, saddle = 0;
  };
  Ridge Between(const Linearization& skin, int a, int b) const;

  const SkinMechanics& mechanics_;
  Eigen::VectorXd height_;
  std::vector<int> order_, basin_, parent_;
  std::vector<double> peak_, mass_;
  std::vector<Vec3> sum_;
};

}  // namespace taclink
