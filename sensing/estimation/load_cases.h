#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <vector>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

/// Load cases of a skin: each is a few loads on sites, by the degrees of freedom of the site's node (three
/// forces, N, and two moments, N mm).
class LoadCases {
 public:
  using Load = Eigen::Matrix<double, kNodeDofs, 1>;
  struct SiteLoad {
    int site = 0;
    Load load = Load::Zero();
  };

  /// Begins another case, without loads.
  void Begin() { first_.push_back(all_.size()); }
  /// To the case begun last.
  void Add(int site, const Load& load) { all_.push_back({site, load}); }

  Eigen::Index count() const { return static_cast<Eigen::Index>(first_.size()); }
  std::span<const SiteLoad> operator[](Eigen::Index index) const {
    const auto i = static_cast<size_t>(index);
    const size_t end = i + 1 < first_.size() ? first_[i + 1] : all_.size();
    return std::span(all_).subspan(first_[i], end - first_[i]);
  }

  /// What several cases load one site with.
  struct OnSite {
    std::vector<Eigen::Index> cases;
    Eigen::Matrix<float, kNodeDofs, Eigen::Dynamic> loads;  ///< by `cases`
  };
  /// By site, of the cases that have at most `most` loads.
  std::map<int, OnSite> BySite(size_t most) const {
    std::map<int, OnSite> sites;
    for (Eigen::Index i = 0; i < count(); ++i) {
      if ((*this)[i].size() > most) continue;
      for (const auto& [site, load] : (*this)[i]) {
        OnSite& on = sites[site];
        on.cases.push_back(i);
        on.loads.conservativeResize(Eigen::NoChange, on.loads.cols() + 1);
        on.loads.rightCols<1>() = load.cast<float>();
      }
    }
    return sites;
  }

 private:
  std::vector<SiteLoad> all_;
  std::vector<size_t> first_;  // by case
};

}  // namespace taclink
