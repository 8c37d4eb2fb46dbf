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
  /// Elements per interval of the marker grid: of what loads do, and of what pressure does, for beside the
  /// clamps the skin bends within less than an interval. From so many markers on they are 1.
  int refinement = 2;
  int pressure_refinement = 3;
  int coarse_from_markers = 400;
};

/// How a skin of revolution can move: the linear shell's answers to loads, at the markers' centres. Vectors
/// hold 3 numbers a marker, by marker index, in the marker's own frame: outward (away from the axis), around
/// (towards rising path numbers), along +Z; mm. For what the linear shell does not know there are bells
/// beside: smooth displacements of a place, in two widths. See map_shape.md. Constant after construction.
class SkinBasis {
 public:
  static constexpr int kBellWidths = 2;
  static constexpr int kWaves = 5;  ///< 1, cos, sin, cos 2, sin 2 of the angle

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
  /// Loads, then bells: 3 a marker and width; then waves: a ring's inward loads on all paths at once, times a
  /// wave round the axis, by wave and then by ring: those at the markers, then those half an interval on.
  int fields() const { return first_wave() + kWaves * wave_rings(); }
  int first_wave() const { return loads() + 3 * markers() * kBellWidths; }
  int wave_rings() const { return columns_on_paths_ - 2 * rings_; }
  static constexpr int HarmonicOf(int wave) { return (wave + 1) / 2; }
  static constexpr bool IsSine(int wave) { return wave > 0 && wave % 2 == 0; }
  /// Load column of a wave's ring.
  int InwardColumn(int wave_ring) const {
    return wave_ring < rings_ ? 3 * wave_ring : 2 * rings_ + wave_ring;
  }
  /// Inward loads are on a grid of half intervals: `path` of 2 paths, round and round, `ring` of 2 rings + 1,
  /// the first half an interval before the first markers'. A field's own place is its marker's.
  struct HalfGrid {
    int path = 0, ring = 0;
  };
  HalfGrid PlaceOf(int field) const;
  /// The inward load there; -1: none.
  int InwardAt(HalfGrid place) const;
  /// The marker where a field is (a wave: where it is largest), or next to it.
  int MarkerOf(int field) const;
  /// A field's turned copies have the same shape: the one on the first path; of waves, itself.
  int OnFirstPath(int field) const;
  bool IsLoad(int field) const { return field < loads(); }
  bool IsInward(int field) const { return field < 3 * markers() ? field / paths_ % 3 == 0 : IsLoad(field); }
  bool IsWave(int field) const { return field >= first_wave(); }
  /// Displacement per N of a load (a wave: of each path's) or per mm of a bell.
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
  void WriteLoad(int field, Eigen::Ref<Eigen::VectorXd>& column) const;
  void WriteBell(int field, Eigen::Ref<Eigen::VectorXd>& column) const;
  void WriteWave(int field, Eigen::Ref<Eigen::VectorXd>& column) const;
  void FindBells(const LinkModel& model);
  void FindWaves();
  void FindInflation(const LinkModel& model);
  void FindModes(const LinkModel& model, const SkinBasisOptions& options);

  int paths_, rings_;
  std::vector<Mat3> frames_;
  Eigen::MatrixXd responses_;  // 3 markers x load columns: to loads on the first path
  std::vector<int> ring_of_column_;
  int columns_on_paths_ = 0;
  Eigen::VectorXd per_pressure_;
  Eigen::MatrixXd inflation_, modes_;
  Eigen::MatrixXd wave_amplitudes_;              // 3 rings x waves
  std::vector<Eigen::MatrixXd> along_, around_;  // by width
  std::vector<int> harmonics_;
  std::vector<Mat3> remainder_;  // by ring
};

}  // namespace taclink
