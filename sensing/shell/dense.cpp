#include "sensing/shell/dense.h"

#include <cassert>
#include <utility>

#include "sensing/shell/one_thread.h"

// BLAS and LAPACK as Fortran has them; OpenBLAS' headers are in no runtime package.
extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void strsm_(const char* side, const char* uplo, const char* trans, const char* diag, const int* m,
            const int* n, const float* alpha, const float* a, const int* lda, float* b, const int* ldb);
void strsv_(const char* uplo, const char* trans, const char* diag, const int* n, const float* a,
            const int* lda, float* x, const int* step);
void sgemv_(const char* trans, const int* m, const int* n, const float* alpha, const float* a, const int* lda,
            const float* x, const int* x_step, const float* beta, float* y, const int* y_step);
void dgemm_(const char* trans_a, const char* trans_b, const int* m, const int* n, const int* k,
            const double* alpha, const double* a, const int* lda, const double* b, const int* ldb,
            const double* beta, double* c, const int* ldc);
void sgemm_(const char* trans_a, const char* trans_b, const int* m, const int* n, const int* k,
            const float* alpha, const float* a, const int* lda, const float* b, const int* ldb,
            const float* beta, float* c, const int* ldc);
void ssyrk_(const char* uplo, const char* trans, const int* n, const int* k, const float* alpha,
            const float* a, const int* lda, const float* beta, float* c, const int* ldc);
void sgetrf_(const int* m, const int* n, float* a, const int* lda, int* pivots, int* info);
void sgetrs_(const char* trans, const int* n, const int* nrhs, const float* a, const int* lda,
             const int* pivots, float* b, const int* ldb, int* info);
void dgetrf_(const int* m, const int* n, double* a, const int* lda, int* pivots, int* info);
void dgetri_(const int* n, double* a, const int* lda, const int* pivots, double* work, const int* size,
             int* info);
}

namespace taclink::dense {
namespace {

int Int(Eigen::Index n) {
  return static_cast<int>(n);
}

void Solve(const char* transposed, const Eigen::MatrixXf& l, Eigen::Ref<Eigen::MatrixXf> b) {
  assert(l.rows() == b.rows());
  const OneThread one_thread;
  const int m = Int(b.rows()), n = Int(b.cols()), lda = Int(l.outerStride()), ldb = Int(b.outerStride());
  const float one = 1;
  const int step = 1;
  if (m > 0 && n == 1)  // A third of the other's time, which copies the factor first.
    strsv_("L", transposed, "N", &m, l.data(), &lda, b.data(), &step);
  else if (m > 0 && n > 0)
    strsm_("L", "L", transposed, "N", &m, &n, &one, l.data(), &lda, b.data(), &ldb);
}

void MultiplyVector(const char* transposed, const Eigen::MatrixXf& a,
                    const Eigen::Ref<const Eigen::VectorXf>& x, Eigen::Ref<Eigen::VectorXf> y) {
  assert(*transposed == 'T' ? a.rows() == x.size() && a.cols() == y.size()
                            : a.cols() == x.size() && a.rows() == y.size());
  const OneThread one_thread;
  const int m = Int(a.rows()), n = Int(a.cols()), lda = Int(a.outerStride()), step = 1;
  const float one = 1, zero = 0;
  if (m == 0 || n == 0)
    y.setZero();
  else
    sgemv_(transposed, &m, &n, &one, a.data(), &lda, x.data(), &step, &zero, y.data(), &step);
}

void Symmetric(const char* transposed, const Eigen::MatrixXf& a, float beta, Eigen::MatrixXf& c) {
  const OneThread one_thread;
  const bool is_gram = *transposed == 'T';
  const int n = Int(is_gram ? a.cols() : a.rows()), k = Int(is_gram ? a.rows() : a.cols());
  const int lda = Int(a.outerStride()), ldc = Int(c.outerStride());
  const float one = 1;
  if (n > 0) ssyrk_("L", transposed, &n, &k, &one, a.data(), &lda, &beta, c.data(), &ldc);
}

void Multiply(float scale, const Eigen::Ref<const Eigen::MatrixXf>& a,
              const Eigen::Ref<const Eigen::MatrixXf>& b, bool transpose_b, float beta,
              Eigen::Ref<Eigen::MatrixXf> c) {
  assert(a.cols() == (transpose_b ? b.cols() : b.rows()) && c.rows() == a.rows());
  const OneThread one_thread;
  const int m = Int(c.rows()), n = Int(c.cols()), k = Int(a.cols()), lda = Int(a.outerStride()),
            ldb = Int(b.outerStride()), ldc = Int(c.outerStride());
  if (m > 0 && n > 0)
    sgemm_("N", transpose_b ? "T" : "N", &m, &n, &k, &scale, a.data(), &lda, b.data(), &ldb, &beta, c.data(),
           &ldc);
}

void MultiplyTransposed(float scale, const Eigen::MatrixXf& a, const Eigen::MatrixXf& b, float beta,
                        Eigen::MatrixXf& c) {
  assert(a.rows() == b.rows() && c.rows() == a.cols() && c.cols() == b.cols());
  const OneThread one_thread;
  const int m = Int(a.cols()), n = Int(b.cols()), k = Int(a.rows()), lda = Int(a.outerStride()),
            ldb = Int(b.outerStride()), ldc = Int(c.outerStride());
  if (m > 0 && n > 0)
    sgemm_("T", "N", &m, &n, &k, &scale, a.data(), &lda, b.data(), &ldb, &beta, c.data(), &ldc);
}

void MultiplyInPlace(const char* transposed_a, const char* transposed_b, double scale, double beta,
                     const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::Ref<const Eigen::MatrixXd>& b,
                     Eigen::Ref<Eigen::MatrixXd> c) {
  const int m = Int(c.rows()), n = Int(c.cols()), k = Int(*transposed_a == 'T' ? a.rows() : a.cols()),
            lda = Int(a.outerStride()), ldb = Int(b.outerStride()), ldc = Int(c.outerStride());
  dgemm_(transposed_a, transposed_b, &m, &n, &k, &scale, a.data(), &lda, b.data(), &ldb, &beta, c.data(),
         &ldc);
}

// Gauss and Jordan's elimination in place [golub2013]. False: a pivot is not positive.
bool EliminatePositive(Eigen::Ref<Eigen::MatrixXd> a) {
  const Eigen::Index n = a.rows();
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!(a(k, k) > 0)) return false;
    const double inverse = 1 / a(k, k);
    for (Eigen::Index j = 0; j < n; ++j) {
      if (j == k) continue;
      const double share = a(k, j) * inverse;
      for (Eigen::Index i = 0; i < n; ++i) a(i, j) -= a(i, k) * share;
      a(k, j) = share;
    }
    a.col(k) *= -inverse;
    a(k, k) = inverse;
  }
  return true;
}

constexpr Eigen::Index kSmall = 24;

// The inverse in place, by halves: matrix products, where a factor and its inverse run at a fifth of their
// speed. False: a pivot is not positive.
bool InvertPositive(Eigen::Ref<Eigen::MatrixXd> a) {
  const Eigen::Index n = a.rows(), first = n / 2, last = n - first;
  if (n <= kSmall) return EliminatePositive(a);
  auto upper = a.topLeftCorner(first, first), lower = a.bottomRightCorner(last, last),
       beside = a.bottomLeftCorner(last, first);
  if (!InvertPositive(upper)) return false;
  Eigen::MatrixXd carried(last, first);
  MultiplyInPlace("N", "N", 1, 0, beside, upper, carried);
  MultiplyInPlace("N", "T", -1, 1, carried, beside, lower);
  if (!InvertPositive(lower)) return false;
  MultiplyInPlace("N", "N", -1, 0, lower, carried, beside);
  MultiplyInPlace("T", "N", -1, 1, carried, beside, upper);
  a.topRightCorner(first, last) = beside.transpose();
  return true;
}

}  // namespace

bool Cholesky(Eigen::MatrixXd& a) {
  const OneThread one_thread;
  const int n = Int(a.rows()), lda = Int(a.outerStride());
  int info = 0;
  if (n > 0) dpotrf_("L", &n, a.data(), &lda, &info);
  return info == 0;
}

void SolveLower(const Eigen::MatrixXf& l, Eigen::Ref<Eigen::MatrixXf> b) {
  Solve("N", l, b);
}
void SolveLowerTransposed(const Eigen::MatrixXf& l, Eigen::Ref<Eigen::MatrixXf> b) {
  Solve("T", l, b);
}

void AddOuter(const Eigen::MatrixXf& a, Eigen::MatrixXf& c) {
  assert(c.rows() == a.rows());
  Symmetric("N", a, 1, c);
}

void AddProduct(double scale, const Eigen::Ref<const Eigen::MatrixXd>& a,
                const Eigen::Ref<const Eigen::MatrixXd>& b, bool transpose_b, Eigen::Ref<Eigen::MatrixXd> c) {
  assert(a.cols() == (transpose_b ? b.cols() : b.rows()) && c.rows() == a.rows());
  const OneThread one_thread;
  const int m = Int(c.rows()), n = Int(c.cols()), k = Int(a.cols()), lda = Int(a.outerStride()),
            ldb = Int(b.outerStride()), ldc = Int(c.outerStride());
  const double one = 1;
  if (m > 0 && n > 0)
    dgemm_("N", transpose_b ? "T" : "N", &m, &n, &k, &scale, a.data(), &lda, b.data(), &ldb, &one, c.data(),
           &ldc);
}

void AddProduct(float scale, const Eigen::Ref<const Eigen::MatrixXf>& a,
                const Eigen::Ref<const Eigen::MatrixXf>& b, bool transpose_b, Eigen::Ref<Eigen::MatrixXf> c) {
  Multiply(scale, a, b, transpose_b, 1, c);
}

void SetProduct(float scale, const Eigen::Ref<const Eigen::MatrixXf>& a,
                const Eigen::Ref<const Eigen::MatrixXf>& b, Eigen::Ref<Eigen::MatrixXf> c) {
  Multiply(scale, a, b, false, 0, c);
}

bool InvertSymmetric(Eigen::MatrixXd& a) {
  const OneThread one_thread;
  const int n = Int(a.rows()), lda = Int(a.outerStride());
  if (n == 0) return true;
  Eigen::MatrixXd inverse = a;
  if (InvertPositive(inverse)) {
    a = std::move(inverse);
    return a.allFinite();
  }
  int info = 0;
  Eigen::VectorXi pivots(n);
  Eigen::VectorXd work(64 * n);
  const int size = Int(work.size());
  dgetrf_(&n, &n, a.data(), &lda, pivots.data(), &info);
  if (info == 0) dgetri_(&n, a.data(), &lda, pivots.data(), work.data(), &size, &info);
  return info == 0 && a.allFinite();
}

void Gram(const Eigen::MatrixXf& a, Eigen::MatrixXf& c) {
  c.resize(a.cols(), a.cols());
  Symmetric("T", a, 0, c);
}

void Product(const Eigen::MatrixXf& a, const Eigen::Ref<const Eigen::VectorXf>& x,
             Eigen::Ref<Eigen::VectorXf> y) {
  MultiplyVector("N", a, x, y);
}

void TransposedProduct(const Eigen::MatrixXf& a, const Eigen::Ref<const Eigen::VectorXf>& x,
                       Eigen::Ref<Eigen::VectorXf> y) {
  MultiplyVector("T", a, x, y);
}

void TransposedProduct(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd& c) {
  const OneThread one_thread;
  c.resize(a.cols(), b.cols());
  const int m = Int(a.cols()), n = Int(b.cols()), k = Int(a.rows()), lda = Int(a.outerStride()),
            ldb = Int(b.outerStride()), ldc = Int(c.outerStride());
  const double one = 1, zero = 0;
  if (m > 0 && n > 0)
    dgemm_("T", "N", &m, &n, &k, &one, a.data(), &lda, b.data(), &ldb, &zero, c.data(), &ldc);
}

void TransposedProduct(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b, Eigen::MatrixXf& c) {
  c.resize(a.cols(), b.cols());
  MultiplyTransposed(1, a, b, 0, c);
}

void AddTransposedProduct(float scale, const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                          Eigen::MatrixXf& c) {
  MultiplyTransposed(scale, a, b, 1, c);
}

bool LuFactor::Set(Eigen::MatrixXf a) {
  assert(a.rows() == a.cols());
  const OneThread one_thread;
  factors_ = std::move(a);
  pivots_.resize(factors_.rows());
  const int n = Int(factors_.rows());
  int info = 0;
  if (n > 0) sgetrf_(&n, &n, factors_.data(), &n, pivots_.data(), &info);
  return info == 0 && factors_.allFinite();
}

void LuFactor::Solve(Eigen::Ref<Eigen::MatrixXf> b) const {
  assert(b.rows() == factors_.rows());
  const OneThread one_thread;
  const int n = Int(b.rows()), count = Int(b.cols()), ldb = Int(b.outerStride());
  int info = 0;
  if (n > 0 && count > 0)
    sgetrs_("N", &n, &count, factors_.data(), &n, pivots_.data(), b.data(), &ldb, &info);
}

}  // namespace taclink::dense
