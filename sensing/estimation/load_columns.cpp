#include "sensing/estimation/load_columns.h"

#include <cassert>
#include <utility>

#include "sensing/shell/dense.h"

namespace taclink {

void LoadColumns::Clear(int loads, Eigen::Index rows) {
  loads_.clear();
  place_.assign(static_cast<size_t>(loads), -1);
  columns_.resize(rows, 0);
  gram_.resize(0, 0);
}

void LoadColumns::AddPlaces(std::span<const int> loads) {
  for (const int load : loads) {
    assert(!Has(load));
    place_[static_cast<size_t>(load)] = static_cast<int>(loads_.size());
    loads_.push_back(load);
  }
}

void LoadColumns::Set(std::span<const int> loads, Eigen::MatrixXf whitened, Eigen::MatrixXf gram) {
  assert(loads_.empty() && whitened.cols() == static_cast<Eigen::Index>(loads.size()));
  AddPlaces(loads);
  columns_ = std::move(whitened);
  gram_ = std::move(gram);
}

void LoadColumns::Append(std::span<const int> loads, const Eigen::MatrixXf& whitened) {
  assert(whitened.cols() == static_cast<Eigen::Index>(loads.size()));
  const Eigen::Index before = columns_.cols(), added = whitened.cols();
  AddPlaces(loads);
  columns_.conservativeResize(whitened.rows(), before + added);
  columns_.rightCols(added) = whitened;
  if (before == 0) {
    dense::Gram(whitened, gram_);
    gram_.triangularView<Eigen::StrictlyUpper>() = gram_.transpose();
    return;
  }
  Eigen::MatrixXf with_all;
  dense::TransposedProduct(columns_, whitened, with_all);
  gram_.conservativeResize(before + added, before + added);
  gram_.rightCols(added) = with_all;
  gram_.bottomRows(added) = with_all.transpose();
}

int LoadColumns::Place(int load) const {
  assert(Has(load));
  return place_[static_cast<size_t>(load)];
}

std::vector<int> LoadColumns::Places(std::span<const int> loads) const {
  std::vector<int> places;
  places.reserve(loads.size());
  for (const int load : loads) places.push_back(Place(load));
  return places;
}

}  // namespace taclink
