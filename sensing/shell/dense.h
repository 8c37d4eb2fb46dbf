#pragma once

#include <Eigen/Core>

namespace taclink::dense {

/// Products and factors of large dense matrices by the BLAS that CHOLMOD uses, in the calling thread alone:
/// it knows the processor's vector instructions, which code compiled for every processor does not (a tenth of
/// the time at 700 rows). Small matrices are Eigen's.

/// The lower Cholesky factor in place; what is above the diagonal is not touched. False: not positive
/// definite.
bool Cholesky(Eigen::MatrixXd& a);
/// b := L^-1 b, or L^-T b.
void SolveLower(const Eigen::MatrixXf& l, Eigen::Ref<Eigen::MatrixXf> b);
void SolveLowerTransposed(const Eigen::MatrixXf& l, Eigen::Ref<Eigen::MatrixXf> b);
/// Lower half of c := c + a a^T.
void AddOuter(const Eigen::MatrixXf& a, Eigen::MatrixXf& c);
/// c := c + scale a b, or scale a b^T.
void AddProduct(double scale, const Eigen::Ref<const Eigen::MatrixXd>& a,
                const Eigen::Ref<const Eigen::MatrixXd>& b, bool transpose_b, Eigen::Ref<Eigen::MatrixXd> c);
void AddProduct(float scale, const Eigen::Ref<const Eigen::MatrixXf>& a,
                const Eigen::Ref<const Eigen::MatrixXf>& b, bool transpose_b, Eigen::Ref<Eigen::MatrixXf> c);
/// c := scale a b.
void SetProduct(float scale, const Eigen::Ref<const Eigen::MatrixXf>& a,
                const Eigen::Ref<const Eigen::MatrixXf>& b, Eigen::Ref<Eigen::MatrixXf> c);
/// The inverse of a symmetric matrix, which need not be definite, in its place. False: singular.
bool InvertSymmetric(Eigen::MatrixXd& a);
/// y := a x, or a^T x.
void Product(const Eigen::MatrixXf& a, const Eigen::Ref<const Eigen::VectorXf>& x,
             Eigen::Ref<Eigen::VectorXf> y);
void TransposedProduct(const Eigen::MatrixXf& a, const Eigen::Ref<const Eigen::VectorXf>& x,
                       Eigen::Ref<Eigen::VectorXf> y);
/// c := a^T b.
void TransposedProduct(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd& c);
void TransposedProduct(const Eigen::MatrixXf& a, const Eigen::MatrixXf& b, Eigen::MatrixXf& c);
/// c := c + scale a^T b.
void AddTransposedProduct(float scale, const Eigen::MatrixXf& a, const Eigen::MatrixXf& b,
                          Eigen::MatrixXf& c);
/// Lower half of c := a^T a.
void Gram(const Eigen::MatrixXf& a, Eigen::MatrixXf& c);

/// Triangular factors of a square matrix with row pivots [golub2013].
class LuFactor {
 public:
  /// False: singular, or not finite.
  bool Set(Eigen::MatrixXf a);
  /// b := A^-1 b.
  void Solve(Eigen::Ref<Eigen::MatrixXf> b) const;

 private:
  Eigen::MatrixXf factors_;
  Eigen::VectorXi pivots_;
};

}  // namespace taclink::dense
