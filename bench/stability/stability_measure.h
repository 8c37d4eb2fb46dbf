#pragma once

#include <vector>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

/// How well the tangent of an equilibrium behaves in arithmetic. Rotations are measured in thicknesses, so
/// that all entries have one unit.
struct TangentNumbers {
  bool definite = false;      ///< else nothing else is known
  double condition = 0;       ///< largest by smallest eigenvalue, by power and inverse iteration
  double backward_error = 0;  ///< of a solve: |K x - b| / (|K| |x| + |b|), largest entries and row sums
  double float_error = 0;     ///< of the same solve in single precision: |x_float - x| / |x|
};
TangentNumbers MeasureTangent(const NonlinearShell& shell, NonlinearShell::Loads loads,
                              const ShellState& state);

/// Betti: the displacement of one degree of freedom by a force on another is that of the other by a force on
/// the one. Both by solving for the equilibrium under small forces of either sign; returns their difference
/// by the larger. NaN: a solve failed.
double Reciprocity(const NonlinearShell& shell, NonlinearShell::Loads loads, const ShellState& state,
                   int dof_a, int dof_b);

/// Largest entry of the residual (N, N mm), in E t^2.
double ResidualOf(const NonlinearShell& shell, NonlinearShell::Loads loads, const ShellState& state);

/// Integral of y by x over an odd number of points in equal steps, by Simpson.
double Simpson(const std::vector<double>& y, double step);

}  // namespace taclink
