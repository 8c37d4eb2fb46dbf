#include "sensing/estimation/site_columns.h"

#include "sensing/shell/dense.h"

namespace taclink {

Eigen::MatrixXf InwardColumns(const SkinMechanics& mechanics, const Linearization& skin,
                              std::span<const int> loads) {
  const int site_count = mechanics.site_count(), around = mechanics.columns();
  LoadCases cases;
  const auto add = [&](int site, double share) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(mechanics.spread(), site); it; ++it) {
      const auto onto = static_cast<int>(it.row());
      cases.Add(onto, share * it.value() * skin.ForceAt(Linearization::kInward, onto));
    }
  };
  for (const int load : loads) {
    cases.Begin();
    if (load < site_count) {
      add(load, 1);
      continue;
    }
    for (int i = 0; i < around; ++i) add((load - site_count) * around + i, 1.0 / around);
  }
  return skin.Displacements(cases);
}

RotatedColumns::RotatedColumns(const SkinMechanics& mechanics, const RingCovariance& covariance,
                               const Linearization& skin) {
  const int groups = covariance.spectrum().groups(), around = mechanics.columns(), wide = around / groups;
  const int rows = mechanics.site_rows();
  std::vector<int> first_sites;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < wide; ++column) first_sites.push_back(row * around + column);
  }
  Eigen::MatrixXf first = InwardColumns(mechanics, skin, first_sites);
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
