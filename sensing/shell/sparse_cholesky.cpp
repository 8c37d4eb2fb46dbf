#include "sensing/shell/sparse_cholesky.h"

#include <cholmod.h>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <new>

#include "sensing/shell/one_thread.h"

namespace taclink {
namespace {

cholmod_sparse ViewOf(const Eigen::SparseMatrix<double>& matrix) {
  assert(matrix.isCompressed());
  cholmod_sparse view = {};
  view.nrow = static_cast<size_t>(matrix.rows());
  view.ncol = static_cast<size_t>(matrix.cols());
  view.nzmax = static_cast<size_t>(matrix.nonZeros());
  view.p = const_cast<int*>(matrix.outerIndexPtr());
  view.i = const_cast<int*>(matrix.innerIndexPtr());
  view.x = const_cast<double*>(matrix.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

cholmod_dense ViewOf(const double* numbers, Eigen::Index rows, Eigen::Index columns, Eigen::Index stride) {
  cholmod_dense view = {};
  view.nrow = static_cast<size_t>(rows);
  view.ncol = static_cast<size_t>(columns);
  view.d = static_cast<size_t>(stride);
  view.nzmax = view.d * view.ncol;
  view.x = const_cast<double*>(numbers);
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  return view;
}

}  // namespace

struct SparseCholesky::State {
  State() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.quick_return_if_not_posdef = 1;
  }
  ~State() {
    cholmod_free_factor(&factor, &common);
    cholmod_free_dense(&solution, &common);
    cholmod_free_dense(&scratch_y, &common);
    cholmod_free_dense(&scratch_e, &common);
    cholmod_finish(&common);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void Solve(cholmod_dense rhs, double* x) {
    const OneThread one_thread;
    if (cholmod_solve2(CHOLMOD_A, factor, &rhs, nullptr, &solution, nullptr, &scratch_y, &scratch_e,
                       &common) == 0) {
      throw std::bad_alloc();
    }
    std::memcpy(x, solution->x, sizeof(double) * rhs.nrow * rhs.ncol);
  }

  cholmod_common common;
  cholmod_factor* factor = nullptr;
  cholmod_dense *solution = nullptr, *scratch_y = nullptr, *scratch_e = nullptr;
};

SparseCholesky::SparseCholesky(const Eigen::SparseMatrix<double>& pattern)
    : state_(std::make_unique<State>()) {
  cholmod_sparse view = ViewOf(pattern);
  state_->factor = cholmod_analyze(&view, &state_->common);
  if (state_->factor == nullptr) throw std::bad_alloc();
}
SparseCholesky::~SparseCholesky() = default;

bool SparseCholesky::Factorise(const Eigen::SparseMatrix<double>& matrix) {
  const OneThread one_thread;
  cholmod_sparse view = ViewOf(matrix);
  cholmod_factorize(&view, state_->factor, &state_->common);
  return state_->common.status == CHOLMOD_OK && state_->factor->minor == state_->factor->n;
}

void SparseCholesky::Solve(const Eigen::Ref<const Eigen::MatrixXd>& rhs, Eigen::MatrixXd& x) {
  x.resize(rhs.rows(), rhs.cols());
  // As many at once as the cache holds: 700 together take three times as long.
  constexpr Eigen::Index kAtOnce = 32;
  for (Eigen::Index first = 0; first < rhs.cols(); first += kAtOnce) {
    const Eigen::Index count = std::min(kAtOnce, rhs.cols() - first);
    state_->Solve(ViewOf(rhs.col(first).data(), rhs.rows(), count, rhs.outerStride()), x.col(first).data());
  }
}

void SparseCholesky::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) {
  x.resize(rhs.size());
  state_->Solve(ViewOf(rhs.data(), rhs.size(), 1, rhs.size()), x.data());
}

Eigen::VectorXd SparseCholesky::Solve(const Eigen::VectorXd& rhs) {
  Eigen::VectorXd x;
  Solve(rhs, x);
  return x;
}

}  // namespace taclink
