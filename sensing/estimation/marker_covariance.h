#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/linearization.h"
#include "sensing/estimation/neighborhoods.h"
#include "sensing/estimation/ring_covariance.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// How wrong the model's markers may be beside the cameras' noise. A shell is no solid: both differ by some
/// percent of the local displacement, alike over a thickness or two; and by forces that the model does not
/// have, carried through its own compliance, which gives soft directions (of a hug, a buckled skin) less
/// weight. Fitted as if it were camera noise that becomes tangential forces of the size of the normal one.
/// One thread.
class MarkerCovariance {
 public:
  /// Both are referred to.
  MarkerCovariance(const SkinMechanics& mechanics, const Neighborhoods& near);

  /// Where the skin is, by which the errors of displacements that no force explains go.
  void SetState(const Linearization& skin, const UntouchedSkin& untouched);
  /// Without loads: a floor, a share of the inflation, the bow and stray forces where nothing presses: inward
  /// at each site, around and along at a quarter of them each, which stand for four. Lower half, stacked
  /// markers. Makes all columns.
  void WriteUntouched(const Linearization& skin, Eigen::MatrixXd& covariance_mm2) const;
  /// The same where `skin` is of revolution. Makes the columns of one group of sites.
  RingCovarianceParts UntouchedParts(const Linearization& skin) const;
  /// Null if the pattern of stray forces is not periodic around the axis.
  const std::shared_ptr<const RingSpectrum>& spectrum() const { return spectrum_; }
  /// What loads add, one column for each independent error of unit variance: a share of the motion, and the
  /// stray forces that are more where something presses. `local_n`: force in the neighborhood of each site.
  /// Sets the stray forces' standard deviations. `mm_per_n`: StrayDisplacements of the skin without loads, by
  /// which those are left out that hide in the cameras' noise, `noise_mm`.
  Eigen::MatrixXf ColumnsOfLoads(const Linearization& skin, const Eigen::VectorXd& local_n,
                                 const std::array<Eigen::VectorXd, 3>& mm_per_n, double noise_mm);
  /// What 1 N of a stray force moves all markers by, mm (root of the sum of squares); by direction and row of
  /// sites.
  std::array<Eigen::VectorXd, 3> StrayDisplacements(const Linearization& skin) const;
  /// The product of the covariance that no force explains (floor, motion, inflation and bow) and forces on
  /// the markers, 1/mm; stacked, mm.
  Eigen::VectorXd Direct(const Eigen::VectorXd& pulls_per_mm) const;
  /// Stacked markers, of one standard deviation: a bow of z along the link, of lenses and of a shell that is
  /// no solid, which cameras at both ends know worst in the middle.
  const Eigen::VectorXd& bow_mm() const { return bow_mm_; }
  /// Standard deviation of a direction in which a marker is not seen.
  double unseen_mm() const { return kUnseenMm * mechanics_.length_unit(); }
  /// Of the stray forces, by direction and site; 0 where there is none.
  const std::array<Eigen::VectorXd, 3>& stray_sigmas_n() const { return stray_n_; }

  /// Forces on sites, or on markers, smoothed over the neighborhood in which they count as local.
  Eigen::VectorXd LocalOfSites(const Eigen::VectorXd& forces_n) const;
  Eigen::VectorXd LocalOfMarkers(const Eigen::VectorXd& forces_n) const {
    return near_.local_markers * forces_n;
  }

 private:
  /// A stray force at a site: standard deviations where nothing presses, and of what is more of it.
  struct Stray {
    Linearization::Direction direction = Linearization::kInward;
    int site = 0;
    double untouched_n = 0, local_n = 0;
  };
  std::vector<Stray> Strays(const Eigen::VectorXd& local_n) const;
  /// Stacked markers, by stray force; of the sites in the first columns of nodes.
  Eigen::MatrixXf UntouchedStrays(const Linearization& skin, int columns) const;
  Eigen::MatrixXd MotionColumns() const;  // by pivoted Cholesky decomposition [harbrecht2012]

  static constexpr double kUnseenMm = 30;  // in SkinMechanics' units

  const SkinMechanics& mechanics_;
  const Neighborhoods& near_;
  Eigen::VectorXd bow_mm_;
  Eigen::Matrix2Xd outward_;  // by marker, unit, at rest
  std::shared_ptr<const RingSpectrum> spectrum_;
  Eigen::VectorXd moved_mm_, grown_mm_;  // by marker, standard deviations; grown_mm_ is alike in a ring
  std::array<Eigen::VectorXd, 3> stray_n_;
};

}  // namespace taclink
