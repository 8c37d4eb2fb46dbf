#include "sensing/mechanics/sparse_cholesky.h"

#include <cholmod.h>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <mutex>
#include <new>

extern "C" {
// OpenBLAS' own; its header is in no runtime package.
void openblas_set_num_threads(int threads);
int openblas_get_parallel();  // 0: the sequential build
// OpenMP's, whose header comes with GCC only.
int omp_get_max_active_levels();
void omp_set_max_active_levels(int levels);
}

namespace taclink {
namespace {

// The sequential build of OpenBLAS shares memory between the threads that call it, and then answers wrongly.
std::mutex* SequentialBlas() {
  static std::mutex sequential;
  static const bool is_sequential = [] {
    openblas_set_num_threads(1);
    return openblas_get_parallel() == 0;
  }();
  return is_sequential ? &sequential : nullptr;
}

// CHOLMOD opens a parallel region for every supernode, whatever the environment's number of threads: on
// matrices of this size its threads only wait, and take the cores from other links.
class OneThread {
 public:
  OneThread() : levels_(omp_get_max_active_levels()) {
    omp_set_max_active_levels(0);
    if (std::mutex* sequential = SequentialBlas(); sequential != nullptr)
      lock_ = std::unique_lock(*sequential);
  }
  ~OneThread() { omp_set_max_active_levels(levels_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int levels_;
  std::unique_lock<std::mutex> lock_;
};

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
  if (rhs.cols() > 0) state_->Solve(ViewOf(rhs.data(), rhs.rows(), rhs.cols(), rhs.outerStride()), x.data());
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
