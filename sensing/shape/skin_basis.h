#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

struct SkinBasisOptions {
  /// Standard deviation of the loads that are there although nothing touches (weight, creep, what the model
  /// gets wrong), each axis, on reference_area_mm2 of skin; independent from place to place.
  double stray_load_n = 0.001;
  double reference_area_mm2 = 180;
  /// Modes whose largest displacement has a smaller standard deviation are left out, and all but so many.
  double least_mode_mm = 0.01;
  int max_modes = 48;
  /// Elements per interval of the marker grid, and the number of markers from which it is 1.
  int refinement = 2;
  int coarse_from_markers = 400;
};

/// How a skin of revolution can move: the linear shell's answers to loads, at the markers' centres. Vectors
/// hold 3 numbers a marker, by marker index, in the marker's own frame: outward (away from the axis), around
/// (towards rising path numbers), along +Z; mm. For what the linear shell does not know there are bells
/// beside: smooth displacements of a place, in two widths. See map_shape.md. Constant after construction.
class SkinBasis {
 public:
  static constexpr int kBellWidths = 2;

  explicit SkinBasis(const LinkModel& model, const SkinBasisOptions& options = {});

  int paths() const { return paths_; }
  int rings() const { return rings_; }
  int markers() const { return paths_ * rings_; }
  /// 3 markers x modes: displacement under stray loads is modes() * q with independent q ~ N(0, 1), and a
  /// rest.
  const Eigen::MatrixXd& modes() const { return modes_; }
  /// Times round the axis that a mode repeats.
  const std::vector<int>& harmonics() const { return harmonics_; }
  /// Covariance of that rest at a marker.
  const Mat3& Remainder(int marker) const { return remainder_[static_cast<size_t>(marker / paths_)]; }
  /// mm per MPa of gauge pressure.
  const Eigen::VectorXd& per_pressure() const { return per_pressure_; }

  /// The same for pressure that varies along the axis as sin(k pi z / L), by k from 1: 3 markers x 4.
  const Eigen::MatrixXd& inflation() const { return inflation_; }

  /// Loads: for each load column one a path. The first columns, 3 a ring, act at the markers: inward along
  /// the normal, around, and the third direction of that frame. The others push inwards half a ring interval
  /// on, half a path on, or both; there are none where the mesh has no nodes there.
  int loads() const { return load_columns() * paths_; }
  int load_columns() const { return static_cast<int>(responses_.cols()); }
  /// How many of them are not half a path on; they come first.
  int columns_on_paths() const { return columns_on_paths_; }
  /// Loads, then bells: 3 a marker and width.
  int fields() const { return loads() + 3 * markers() * kBellWidths; }
  /// The marker where a field is, or next to it.
  int MarkerOf(int field) const;
  /// A field's turned copies have the same shape: the one on the first path.
  int OnFirstPath(int field) const;
  bool IsLoad(int field) const { return field < loads(); }
  /// Displacement per N of a load or per mm of a bell.
  void WriteField(int field, Eigen::Ref<Eigen::VectorXd> column) const;
  /// A bell's displacement at `ring` of those centred on `center` is Along(..)(center, ring) *
  /// Around(..)(center, paths between).
  const Eigen::MatrixXd& Along(int width) const { return along_[static_cast<size_t>(width)]; }
  const Eigen::MatrixXd& Around(int width) const { return around_[static_cast<size_t>(width)]; }

  /// Answers to waves of loads round the axis: amplitudes (3 a ring) of a displacement that varies as cos(h
  /// angle), its part around as sin(h angle), from those of loads that vary likewise; 3 rings x load columns.
  Eigen::MatrixXd Harmonic(int h) const;

  /// link_from_local rotation of a marker.
  const Mat3& Frame(int marker) const { return frames_[static_cast<size_t>(marker)]; }

 private:
  void Solve(const LinkModel& model, const SkinBasisOptions& options);
  Eigen::MatrixXd MarkerHarmonic(int h) const { return Harmonic(h).leftCols(3 * rings_); }
  void FindBells(const LinkModel& model);
  void FindInflation(const LinkModel& model);
  void FindModes(const LinkModel& model, const SkinBasisOptions& options);

  int paths_, rings_;
  std::vector<Mat3> frames_;
  Eigen::MatrixXd responses_;  // 3 markers x load columns: to loads on the first path
  std::vector<int> ring_of_column_;
  int columns_on_paths_ = 0;
  Eigen::VectorXd per_pressure_;
  Eigen::MatrixXd inflation_, modes_;
  std::vector<Eigen::MatrixXd> along_, around_;  // by width
  std::vector<int> harmonics_;
  std::vector<Mat3> remainder_;  // by ring
};

}  // namespace taclink
