#pragma once

#include <Eigen/Core>
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

 private:
  std::vector<SiteLoad> all_;
  std::vector<size_t> first_;  // by case
};

}  // namespace taclink
