#include "sensing/estimation/site_columns.h"

#include "sensing/shell/dense.h"

namespace taclink {

Eigen::MatrixXf SiteColumns(const SkinMechanics& mechanics, Linearization& skin, std::span<const int> sites) {
  using Shares = Eigen::SparseMatrix<double>::InnerIterator;
  std::vector<int> loaded;
  for (const int site : sites) {
    for (Shares it(mechanics.spread(), site); it; ++it) loaded.push_back(static_cast<int>(it.row()));
  }
  skin.MakeColumns(loaded);
  Eigen::MatrixXf columns =
      Eigen::MatrixXf::Zero(3 * mechanics.marker_count(), static_cast<Eigen::Index>(sites.size()));
  for (Eigen::Index i = 0; i < columns.cols(); ++i) {
    for (Shares it(mechanics.spread(), sites[static_cast<size_t>(i)]); it; ++it)
      columns.col(i) +=
          static_cast<float>(it.value()) * skin.Column(Linearization::kInward, static_cast<int>(it.row()));
  }
  return columns;
}

RotatedColumns::RotatedColumns(const SkinMechanics& mechanics, const RingCovariance& covariance,
                               Linearization& skin) {
  const int groups = covariance.spectrum().groups(), around = mechanics.columns(), wide = around / groups;
  const int rows = mechanics.site_rows();
  std::vector<int> first_sites;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < wide; ++column) first_sites.push_back(row * around + column);
  }
  Eigen::MatrixXf first = SiteColumns(mechanics, skin, first_sites);
  covariance.Whiten(first);
  const Eigen::Index count = first.cols(), sites = groups * count;
  whitened.resize(first.rows(), sites + rows);
  gram.resize(sites + rows, sites + rows);
  for (int group = 0; group < groups; ++group) {
    covariance.RotateWhitened(first, group, whitened.middleCols(group * count, count));
    for (const int site : first_sites) loads.push_back(site + group * wide);
  }
  const Eigen::MatrixXf sums = covariance.SumOfRotations(first);
  for (int row = 0; row < rows; ++row) {
    whitened.col(sites + row) =
        sums.middleCols(row * wide, wide).rowwise().sum() / static_cast<float>(around);
    loads.push_back(mechanics.site_count() + row);
  }
  Eigen::MatrixXf products;
  dense::TransposedProduct(first, whitened, products);
  for (int column = 0; column < groups; ++column) {
    for (int group = 0; group < groups; ++group)
      gram.block(group * count, column * count, count, count) =
          products.middleCols((column - group + groups) % groups * count, count);
    gram.block(column * count, sites, count, rows) = products.rightCols(rows);
  }
  const Eigen::MatrixXf bands = whitened.rightCols(rows);
  gram.bottomRightCorner(rows, rows) = bands.transpose() * bands;
  gram.bottomLeftCorner(rows, sites) = gram.topRightCorner(sites, rows).transpose();
}

}  // namespace taclink
