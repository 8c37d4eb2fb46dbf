#include "sensing/shell/ring_stiffness.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

#include "sensing/shell/instructions.h"

namespace taclink {
namespace {

constexpr int kWidth = RingBlocks::kWidth;
// A turn about the tangent is even only if the tangent is the circumference's.
constexpr double kTangential = 1e-9;

// Cosine and sine of the angle of a column of nodes at rest.
std::array<double, 2> TurnOf(const NonlinearShell& shell, int column) {
  const Vec2 at = shell.surface().mids_mm[static_cast<size_t>(column)].head<2>().normalized();
  return {at.x(), at.y()};
}

// An element's part with its corners' translations in cylindrical coordinates.
void TurnPart(const std::array<std::array<double, 2>, 2>& turns, NonlinearShell::ElementPart& part) {
  constexpr std::array<size_t, 4> kColumn = {0, 1, 1, 0};
  for (Eigen::Index i = 0; i < 4; ++i) {
    const auto [c, s] = turns[kColumn[static_cast<size_t>(i)]];
    Mat2 turn;
    turn << c, s, -s, c;
    const Eigen::Index at = kNodeDofs * i;
    part.gradient.segment<2>(at) = (turn * part.gradient.segment<2>(at)).eval();
    part.hessian.middleRows<2>(at) = (turn * part.hessian.middleRows<2>(at)).eval();
    part.hessian.middleCols<2>(at) = (part.hessian.middleCols<2>(at) * turn.transpose()).eval();
  }
}

}  // namespace

bool RingBlocks::Fit(const NonlinearShell& shell) {
  if (!shell.rings()) return false;
  const int columns = shell.rings()->columns(), rows = shell.rings()->rows();
  int next = 0;
  for (int node = 0; node < shell.node_count(); ++node) {
    const int row = node / columns;
    const bool is_clamped = row == 0 || row == rows - 1;
    for (int c = 0; c < kNodeDofs; ++c) {
      if (shell.Dof(node, c) != (is_clamped ? -1 : next++)) return false;
    }
    const auto i = static_cast<size_t>(node);
    const auto [cosine, sine] = TurnOf(shell, node % columns);
    const Vec3 around(-sine, cosine, 0);
    if ((shell.surface().tangents[i] - around).norm() > kTangential) return false;
  }
  return true;
}

// By symmetry, the element on the other side of a column of nodes contributes the terms of this element's
// second column of corners.
double RingBlocks::Set(const NonlinearShell& shell, const ShellState& state, NonlinearShell::Loads loads,
                       Eigen::VectorXd& gradient) {
  const int columns = shell.rings()->columns(), rows = shell.rings()->rows();
  const Eigen::Index dofs = kNodeDofs * (rows - 2);
  for (Banded* block : {&own, &sum, &difference}) block->setZero(dofs, kWidth);
  gradient.setZero(dofs);
  const std::array<std::array<double, 2>, 2> turns = {TurnOf(shell, 0), TurnOf(shell, 1)};
  double energy_nmm = 0;
  NonlinearShell::ElementPart part;
  for (int ring = 0; ring + 1 < rows; ++ring) {
    shell.SetElementPart(ring * columns, state, loads, part);
    energy_nmm += columns * part.energy_nmm;
    TurnPart(turns, part);
    // Corners on the ring's lower and upper row of nodes, in the first column and in the second.
    constexpr std::array<std::array<Eigen::Index, 2>, 2> kCorner = {{{0, 1}, {3, 2}}};
    for (size_t upper = 0; upper < 2; ++upper) {
      const Eigen::Index row = ring - 1 + static_cast<Eigen::Index>(upper);  // of nodes that move
      if (row < 0 || row >= rows - 2) continue;
      const Eigen::Index i = kNodeDofs * kCorner[upper][0], i_next = kNodeDofs * kCorner[upper][1];
      gradient.segment<kNodeDofs>(kNodeDofs * row) +=
          part.gradient.segment<kNodeDofs>(i) + part.gradient.segment<kNodeDofs>(i_next);
      for (size_t other = 0; other <= upper; ++other) {
        const Eigen::Index to = row - static_cast<Eigen::Index>(upper - other);
        if (to < 0) continue;
        const Eigen::Index j = kNodeDofs * kCorner[other][0], j_next = kNodeDofs * kCorner[other][1];
        const Eigen::Index at = kNodeDofs * row, first = upper == other ? kNodeDofs : 0;
        const auto& k = part.hessian;
        own.block<kNodeDofs, kNodeDofs>(at, first) +=
            k.block<kNodeDofs, kNodeDofs>(i, j) + k.block<kNodeDofs, kNodeDofs>(i_next, j_next);
        sum.block<kNodeDofs, kNodeDofs>(at, first) +=
            k.block<kNodeDofs, kNodeDofs>(i, j_next) + k.block<kNodeDofs, kNodeDofs>(i_next, j);
        difference.block<kNodeDofs, kNodeDofs>(at, first) +=
            k.block<kNodeDofs, kNodeDofs>(i, j_next) - k.block<kNodeDofs, kNodeDofs>(i_next, j);
      }
    }
  }
  return energy_nmm;
}

RingStiffness::RingStiffness(const NonlinearShell& shell)
    : columns_(shell.rings()->columns()),
      rows_(shell.rings()->rows() - 2),
      dofs_(kNodeDofs * rows_),
      harmonics_(columns_ / 2 + 1),
      blocks_((harmonics_ + kLanes - 1) / kLanes),
      padded_columns_((columns_ + kLanes - 1) / kLanes * kLanes) {
  for (int column = 0; column < columns_; ++column) turns_.push_back(TurnOf(shell, column));
  const int lanes = blocks_ * kLanes;
  for (auto* table : {&cosine_, &sine_}) table->assign(static_cast<size_t>(columns_ * lanes), 0);
  for (auto* table : {&cosine_back_, &sine_back_})
    table->assign(static_cast<size_t>(harmonics_ * padded_columns_), 0);
  for (int c = 0; c < columns_; ++c) {
    for (int k = 0; k < harmonics_; ++k) {
      const double scale = std::sqrt((k == 0 || 2 * k == columns_ ? 1.0 : 2.0) / columns_);
      const double angle = 2 * kPi * ((k * c) % columns_) / columns_;
      const auto there = static_cast<size_t>(c * lanes + k),
                 back = static_cast<size_t>(k * padded_columns_ + c);
      cosine_[there] = cosine_back_[back] = static_cast<float>(scale * std::cos(angle));
      sine_[there] = sine_back_[back] = static_cast<float>(scale * std::sin(angle));
    }
  }
}

// Cholesky [golub2013] within the band.
bool RingStiffness::Factorize(const RingBlocks& blocks) {
  factor_.assign(static_cast<size_t>(blocks_ * dofs_ * kWidth * kLanes), 0);
  inverse_diagonal_.assign(static_cast<size_t>(blocks_ * dofs_ * kLanes), 1);
  std::vector<double> lower(static_cast<size_t>(dofs_ * kWidth));  // by row and row - column
  for (int k = 0; k < harmonics_; ++k) {
    const double angle = 2 * kPi * k / columns_, c = std::cos(angle), s = std::sin(angle);
    for (int i = 0; i < dofs_; ++i) {
      const int first = std::max(0, i / kNodeDofs - 1) * kNodeDofs,
                shift = i / kNodeDofs * kNodeDofs - kNodeDofs;
      double* row = lower.data() + static_cast<ptrdiff_t>(i * kWidth);
      for (int j = first; j <= i; ++j) {
        const int at = j - shift;
        double sum = RingBlocks::IsOdd(i) == RingBlocks::IsOdd(j)
                         ? blocks.own(i, at) + c * blocks.sum(i, at)
                         : (RingBlocks::IsOdd(i) ? s : -s) * blocks.difference(i, at);
        const double* other = lower.data() + static_cast<ptrdiff_t>(j * kWidth);
        const int other_first = std::max(0, j / kNodeDofs - 1) * kNodeDofs;
        for (int m = std::max(first, other_first); m < j; ++m) sum -= row[i - m] * other[j - m];
        if (j < i) {
          row[i - j] = sum / other[0];
        } else {
          if (!(sum > 0) || !std::isfinite(sum)) return false;
          row[0] = std::sqrt(sum);
        }
      }
      float* to = factor_.data() + static_cast<ptrdiff_t>(((k / kLanes) * dofs_ + i) * kWidth * kLanes);
      for (int d = 0; d <= i - first; ++d) to[d * kLanes + k % kLanes] = static_cast<float>(row[d]);
      inverse_diagonal_[static_cast<size_t>(((k / kLanes) * dofs_ + i) * kLanes + k % kLanes)] =
          static_cast<float>(1 / row[0]);
    }
  }
  return true;
}

namespace {

typedef float FloatLanes __attribute__((vector_size(32)));
constexpr int kFloatLanes = 8;

struct SolveArguments {
  int columns, padded_columns, dofs, harmonics, blocks;
  const float *cosine, *sine, *cosine_back, *sine_back, *factor, *inverse_diagonal;
  float* by_column;  // by unknown of a column, by column, padded: loads, then the solution
  float* harmonic;   // by unknown, of a block: both parts of the transform
  float* spectrum;   // by unknown and harmonic: both parts of the solution's
};

TACLINK_IN_KERNEL void Get(const float* from, FloatLanes& v) {
  std::memcpy(&v, from, sizeof v);
}
TACLINK_IN_KERNEL void Put(const FloatLanes& v, float* to) {
  std::memcpy(to, &v, sizeof v);
}

// Parts by cosine and sine of all unknowns, for the harmonics of a block; odd unknowns over i.
TACLINK_IN_KERNEL void Transform(const SolveArguments& in, int block) {
  for (int i = 0; i < in.dofs; ++i) {
    const float* x = in.by_column + static_cast<ptrdiff_t>(i * in.padded_columns);
    FloatLanes a = {}, b = {}, table;
    for (int c = 0; c < in.columns; ++c) {
      const ptrdiff_t at = (c * in.blocks + block) * kFloatLanes;
      Get(in.cosine + at, table);
      a += x[c] * table;
      Get(in.sine + at, table);
      b += x[c] * table;
    }
    float* to = in.harmonic + static_cast<ptrdiff_t>(2 * i * kFloatLanes);
    const bool is_odd = RingBlocks::IsOdd(i);
    Put(is_odd ? -b : a, to);
    Put(is_odd ? a : b, to + kFloatLanes);
  }
}

// Forward and back substitution of both parts at once.
TACLINK_IN_KERNEL void Substitute(const SolveArguments& in, int block) {
  const float* factor = in.factor + static_cast<ptrdiff_t>(block * in.dofs * kWidth * kFloatLanes);
  const float* inverse = in.inverse_diagonal + static_cast<ptrdiff_t>(block * in.dofs * kFloatLanes);
  const auto at = [&](int i) { return in.harmonic + static_cast<ptrdiff_t>(2 * i * kFloatLanes); };
  FloatLanes a, b, l, x;
  for (int i = 0; i < in.dofs; ++i) {
    Get(at(i), a);
    Get(at(i) + kFloatLanes, b);
    const float* row = factor + static_cast<ptrdiff_t>(i * kWidth * kFloatLanes);
    for (int d = std::min(kWidth - 1, i); d >= 1; --d) {
      Get(row + d * kFloatLanes, l);
      Get(at(i - d), x);
      a -= l * x;
      Get(at(i - d) + kFloatLanes, x);
      b -= l * x;
    }
    Get(inverse + i * kFloatLanes, l);
    Put(a * l, at(i));
    Put(b * l, at(i) + kFloatLanes);
  }
  for (int i = in.dofs - 1; i >= 0; --i) {
    Get(at(i), a);
    Get(at(i) + kFloatLanes, b);
    for (int d = 1; d < kWidth && i + d < in.dofs; ++d) {
      Get(factor + static_cast<ptrdiff_t>(((i + d) * kWidth + d) * kFloatLanes), l);
      Get(at(i + d), x);
      a -= l * x;
      Get(at(i + d) + kFloatLanes, x);
      b -= l * x;
    }
    Get(inverse + i * kFloatLanes, l);
    Put(a * l, at(i));
    Put(b * l, at(i) + kFloatLanes);
  }
}

TACLINK_IN_KERNEL void TransformBack(const SolveArguments& in) {
  const int lanes = in.blocks * kFloatLanes;
  for (int i = 0; i < in.dofs; ++i) {
    const float *cosine = in.spectrum + static_cast<ptrdiff_t>(2 * i * lanes), *sine = cosine + lanes;
    for (int c = 0; c < in.padded_columns; c += kFloatLanes) {
      FloatLanes x = {}, table;
      for (int k = 0; k < in.harmonics; ++k) {
        Get(in.cosine_back + static_cast<ptrdiff_t>(k * in.padded_columns + c), table);
        x += cosine[k] * table;
        Get(in.sine_back + static_cast<ptrdiff_t>(k * in.padded_columns + c), table);
        x += sine[k] * table;
      }
      Put(x, in.by_column + static_cast<ptrdiff_t>(i * in.padded_columns + c));
    }
  }
}

TACLINK_IN_KERNEL void SolveAll(const SolveArguments& in) {
  const int lanes = in.blocks * kFloatLanes;
  for (int block = 0; block < in.blocks; ++block) {
    Transform(in, block);
    Substitute(in, block);
    for (int i = 0; i < in.dofs; ++i) {
      const float *a = in.harmonic + static_cast<ptrdiff_t>(2 * i * kFloatLanes), *b = a + kFloatLanes;
      float* cosine = in.spectrum + static_cast<ptrdiff_t>(2 * i * lanes + block * kFloatLanes);
      FloatLanes by_a, by_b;
      Get(a, by_a);
      Get(b, by_b);
      const bool is_odd = RingBlocks::IsOdd(i);
      Put(is_odd ? by_b : by_a, cosine);
      Put(is_odd ? -by_a : by_b, cosine + lanes);
    }
  }
  TransformBack(in);
}

void SolvePlain(const SolveArguments& in) {
  SolveAll(in);
}
TACLINK_FOR_AVX2 void SolveAvx2(const SolveArguments& in) {
  SolveAll(in);
}

}  // namespace

// To cylindrical coordinates.
void RingStiffness::Load(const Eigen::VectorXd& rhs, std::vector<float>& by_column) const {
  by_column.resize(static_cast<size_t>(dofs_ * padded_columns_));
  for (int row = 0; row < rows_; ++row) {
    float* to = by_column.data() + static_cast<ptrdiff_t>(row * kNodeDofs * padded_columns_);
    for (int c = 0; c < columns_; ++c) {
      const double* p = rhs.data() + static_cast<ptrdiff_t>(kNodeDofs * (row * columns_ + c));
      const auto [cosine, sine] = turns_[static_cast<size_t>(c)];
      to[c] = static_cast<float>(cosine * p[0] + sine * p[1]);
      to[padded_columns_ + c] = static_cast<float>(cosine * p[1] - sine * p[0]);
      for (int a = 2; a < kNodeDofs; ++a) to[a * padded_columns_ + c] = static_cast<float>(p[a]);
    }
  }
}

void RingStiffness::Store(const std::vector<float>& by_column, Eigen::VectorXd& x) const {
  x.resize(dofs_ * columns_);
  for (int row = 0; row < rows_; ++row) {
    const float* from = by_column.data() + static_cast<ptrdiff_t>(row * kNodeDofs * padded_columns_);
    for (int c = 0; c < columns_; ++c) {
      double* p = x.data() + static_cast<ptrdiff_t>(kNodeDofs * (row * columns_ + c));
      const auto [cosine, sine] = turns_[static_cast<size_t>(c)];
      const double radial = from[c], around = from[padded_columns_ + c];
      p[0] = cosine * radial - sine * around;
      p[1] = sine * radial + cosine * around;
      for (int a = 2; a < kNodeDofs; ++a) p[a] = from[a * padded_columns_ + c];
    }
  }
}

// Loads, then the solution.
void RingStiffness::SolveByColumn(std::vector<float>& by_column) const {
  // Eight lanes of single precision fill the registers of AVX2.
  static void (*const kKernel)(const SolveArguments&) = BestOf(SolvePlain, SolveAvx2, SolveAvx2);
  thread_local std::vector<float> harmonic, spectrum;
  harmonic.resize(static_cast<size_t>(2 * dofs_ * kLanes));
  spectrum.resize(static_cast<size_t>(2 * dofs_ * blocks_ * kLanes));
  kKernel({columns_, padded_columns_, dofs_, harmonics_, blocks_, cosine_.data(), sine_.data(),
           cosine_back_.data(), sine_back_.data(), factor_.data(), inverse_diagonal_.data(), by_column.data(),
           harmonic.data(), spectrum.data()});
}

void RingStiffness::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const {
  assert(rhs.size() == dofs_ * columns_);
  thread_local std::vector<float> by_column;
  Load(rhs, by_column);
  SolveByColumn(by_column);
  Store(by_column, x);
}

Eigen::MatrixXf RingStiffness::Inverse() const {
  Eigen::MatrixXf inverse((columns_ / 2 + 1) * dofs_, dofs_);
  std::vector<float> by_column;
  for (int load = 0; load < dofs_; ++load) {
    by_column.assign(static_cast<size_t>(dofs_ * padded_columns_), 0);
    by_column[static_cast<size_t>(load * padded_columns_)] = 1;
    SolveByColumn(by_column);
    for (int difference = 0; difference <= columns_ / 2; ++difference) {
      for (int i = 0; i < dofs_; ++i)
        inverse(difference * dofs_ + i, load) =
            by_column[static_cast<size_t>(i * padded_columns_ + difference)];
    }
  }
  return inverse;
}

}  // namespace taclink
