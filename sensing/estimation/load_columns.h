#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace taclink {

/// Whitened columns of loads, of those only that were asked for, and their Gram matrix. Loads have numbers
/// from 0; those with a column have a place among the columns as well. One thread.
class LoadColumns {
 public:
  /// No columns, of `loads` loads; those to come have `rows` rows.
  void Clear(int loads, Eigen::Index rows);
  /// Columns of these loads, which have none yet; `whitened`: one column a load.
  void Append(std::span<const int> loads, const Eigen::MatrixXf& whitened);
  /// The first columns, whose Gram matrix is known.
  void Set(std::span<const int> loads, Eigen::MatrixXf whitened, Eigen::MatrixXf gram);

  bool Has(int load) const { return place_[static_cast<size_t>(load)] >= 0; }
  bool HasAll() const { return loads_.size() == place_.size(); }
  /// By place.
  const std::vector<int>& loads() const { return loads_; }
  const Eigen::MatrixXf& columns() const { return columns_; }
  const Eigen::MatrixXf& gram() const { return gram_; }

  /// The loads must have columns.
  int Place(int load) const;
  std::vector<int> Places(std::span<const int> loads) const;
  auto Column(int load) const { return columns_.col(Place(load)); }

 private:
  void AddPlaces(std::span<const int> loads);

  std::vector<int> loads_, place_;  // place_: by load, -1: none
  Eigen::MatrixXf columns_, gram_;
};

}  // namespace taclink
