#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/camera_modes.h"
#include "sensing/estimation/hills.h"
#include "sensing/estimation/linearization.h"
#include "sensing/estimation/load_columns.h"
#include "sensing/estimation/marker_covariance.h"
#include "sensing/estimation/nonnegative.h"
#include "sensing/estimation/untouched_covariance.h"
#include "sensing/estimation/whitening.h"

namespace taclink {

/// One contact's load.
struct EstimatedLoad {
  std::vector<int> sites;
  std::vector<double> inward_n;  ///< by `sites`; spreads over the neighbors of each
  std::vector<double> shares;    ///< by `sites`, of the tangential force; sum to 1
  bool is_ring_contact = false;  ///< all around the skin, alike: without a resultant across it
  bool has_tangential = false;
  Vec2 tangential_n = Vec2::Zero();  ///< around and along
  Vec2 couple_nmm = Vec2::Zero();    ///< about around and along: a glued body may turn the skin
  Vec2 left_out_n = Vec2::Zero();    ///< a tangential force that may be there, but explains too little
  Vec3 force_n = Vec3::Zero();       ///< link frame
  double normal_force_n = 0;         ///< sum of the inward loads
  /// Column (not wrapped) and row of the site grid: centroid of the inward loads and, as far as there is one,
  /// of where the tangential force acts.
  Vec2 center = Vec2::Zero();
  Vec2 tangential_center = Vec2::Zero();  ///< likewise, of `shares`
  Mat3 force_covariance_n2 = Mat3::Zero();
  Mat2 center_covariance = Mat2::Zero();  ///< of `center`
};

/// The weakest inward loads that would be told 95 times in 100 (limits of detection [currie1968]), N.
struct DetectionLimits {
  Eigen::VectorXd by_site_n;  ///< where nothing else presses nearby
  double around_n = 0;        ///< of what presses alike all around, the sum; at the worst row of sites
};

struct LoadEstimate {
  std::vector<EstimatedLoad> loads;
  Linearization::SiteLoads at_sites;  ///< all of them and the stray forces
  Eigen::VectorXd contact_sizes_n;    ///< by site, of the contacts alone
  /// Where the markers are beside the equilibrium, by what they say and by how wrong the model may be; and
  /// how far beside that they seem to be by cameras that have moved or changed since the baseline. mm,
  /// stacked. Empty: nothing was fitted.
  Eigen::VectorXd beside_mm, by_cameras_mm;
  double camera_shift_mm = 0;  ///< the latter's longest, of a marker
  /// Likewise, as each camera by itself sees them, across its lines of sight. Empty: nothing was fitted.
  std::array<Eigen::VectorXd, kCameraCount> by_camera_mm;
  Vec4 known_error = Vec4::Zero();       ///< of the known loads: true less measured, as KnownLoads::Stacked()
  Vec4 baseline_error = Vec4::Zero();    ///< likewise, of those under which the baseline was taken
  Mat4 known_covariance = Mat4::Zero();  ///< of the corrected known loads
  double chi2_per_dof = 0;
  double region_chi2_per_dof = 0;  ///< the largest of 3 x 3 markers
  bool converged = true;
  int trials = 0;  ///< answers to which contacts there are, and which of them pull along the wall, tried
};

/// What LoadEstimator::Fit may find.
struct FitOptions {
  bool may_be_ring = true;     ///< several contacts all around may be taken for one ring contact
  bool has_tangential = true;  ///< contacts may have tangential forces
};

/// The loads that explain the markers, given the linearized skin: non-negative inward loads [lawson1974] at
/// all sites with a sparsity term that fades inside a hill, grouped into hills, those hills that explain
/// little left out, and a tangential force for each hill that needs one. See estimation.md. One thread.
class LoadEstimator {
 public:
  /// Both are referred to.
  LoadEstimator(const SkinMechanics& mechanics, const Neighborhoods& near);

  /// What does not change from frame to frame while the linearization, the cameras' noise and the loads'
  /// sizes stay as they are: covariance, whitened columns and their products. `local_n`: force in the
  /// neighborhood of each site, for the model's errors. `untouched`: of the skin without loads; columns are
  /// then made where loads are likely, and others when they are asked for. Null: this is that skin, and all
  /// columns are made. False: the covariance has no factor.
  bool Prepare(Linearization& skin, const UntouchedSkin& untouched_skin, const MarkerObservations& observed,
               const KnownLoadsPrior& prior, const Eigen::VectorXd& local_n,
               std::shared_ptr<const UntouchedCovariance> untouched);
  /// Whether these observations are nearly as good, everywhere, as those that were prepared for, and count
  /// from the same baseline; what is missing now does not matter.
  bool IsPreparedFor(const MarkerObservations& observed, const KnownLoadsPrior& prior) const;
  /// Whether it was prepared for loads that are known about as well.
  bool HasKnownLoads(const KnownLoadsPrior& prior) const;

  /// After Prepare. The linearization may have been rebased. Covariances and what is left unexplained are not
  /// written. `untouched_norms`: FreeNorms() of the skin without loads, shown the same observations, which
  /// stand for the norms of columns that are not made; null where all are.
  void Fit(Linearization& skin, const MarkerObservations& observed, const Eigen::VectorXd* untouched_norms,
           const FitOptions& options, LoadEstimate& estimate);
  /// Writes these for what was fitted last.
  void Conclude(Linearization& skin, LoadEstimate& estimate);

  /// After Prepare: which markers are not in sight now.
  void Hide(const MarkerObservations& observed);
  /// Instead of Fit and Conclude, where there is nothing to fit.
  void ConcludeUntouched(const MarkerObservations& observed) {
    Hide(observed);
    WriteMarkerCovariances();
  }
  /// After Prepare: of known loads whose errors are fitted, where all markers are seen.
  Mat4 KnownCovariance() const {
    return known_errors_ * whitening_.LastPosterior(known_errors_.cols()) * known_errors_.transpose();
  }
  /// Of what the last Fit or Hide was shown, where all columns are made; nothing is allocated as long as that
  /// stays.
  const DetectionLimits& Limits();
  /// Likewise: norms of the loads' whitened columns beside what is hidden.
  const Eigen::VectorXd& FreeNorms();
  /// After Prepare.
  const std::shared_ptr<const UntouchedCovariance>& untouched() const { return untouched_; }

  /// The frames before.
  void Forget() { chosen_.clear(); }

  const MarkerCovariance& covariance() const { return covariance_; }
  /// Covariance of the model's error at a marker, after Conclude.
  Mat3 ModelCovariance(int marker) const { return model_covariance_.at(static_cast<size_t>(marker)); }
  /// Likewise, of what is not known of the cameras' motion once all markers were seen.
  Mat3 CameraCovariance(int marker) const { return camera_covariance_.at(static_cast<size_t>(marker)); }

 private:
  /// Standard deviation of a tangential force that was let in, N in SkinMechanics' units.
  static constexpr double kTangentialN = 1;
  /// And of a couple, N mm: that force on an arm of a patch's size.
  static constexpr double kCoupleNmm = 10;
  /// What a contact has to explain, of chi^2.
  static constexpr double kHillGain = 20;
  /// Of a band's norm: it has to explain so many standard deviations. It is rarer than other loads, and
  /// errors of the model look like a little of one.
  static constexpr double kBandSparsity = 12;
  /// N in SkinMechanics' units.
  static constexpr double kLeastHillN = 0.01;
  /// Of a Gram matrix in single precision.
  static constexpr float kRounding = 1e-6F;
  using Direction = std::pair<int, Vec3>;  // first row of the marker, unit vector
  static bool AreSame(const std::vector<Direction>& a, const std::vector<Direction>& b);
  /// Columns of the problem that are one contact: sites or, of a hug, bands.
  using Hill = HillFinder::Hill;

  Eigen::MatrixXf ColumnsOfNoise(const MarkerObservations& observed);
  void WriteMarkerCovariances();
  void WriteModelCovariances();
  void WriteCameraCovariances();
  Eigen::LLT<Eigen::MatrixXf> FactorOf(const std::vector<int>& markers) const;
  double NoiseDistance(const std::vector<int>& markers, const Eigen::VectorXf& left_mm) const;
  void MakeColumns(const Linearization& skin, std::vector<int> loads);
  void AddColumns(const Linearization& skin, std::vector<int> loads);
  void MakeRotatedColumns(const Linearization& skin);
  std::vector<int> LikelyLoads(const Eigen::VectorXd& local_n) const;
  /// The sites that a column of the problem loads, and the share of each: one site, or a band's.
  template <typename Visit>
  void ForSites(int column, Visit visit) const {
    const int sites = mechanics_.site_count(), around = mechanics_.columns();
    if (column < sites) return visit(column, 1.0);
    for (int i = 0; i < around; ++i) visit((column - sites) * around + i, 1.0 / around);
  }
  double MeanOver(int column, const Eigen::VectorXd& by_site) const;
  bool IsBand(int column) const { return column >= mechanics_.site_count(); }
  void ShareBands(const Eigen::VectorXd& inward_n, const std::vector<int>& loads);
  void JoinHugs(const Linearization& skin, std::vector<Hill>& hills);
  void JoinHug(const Linearization& skin, std::vector<Hill>& hills, const std::vector<size_t>& group);
  Eigen::VectorXd Penalties(const Eigen::VectorXd& near_n) const;  // reweighted l1 [candes2008]
  void WriteNorms(const Eigen::VectorXd* untouched_norms);
  void SolveSparse(const Eigen::VectorXd& near_n);
  bool LetIn(Linearization& skin, bool all);
  Eigen::VectorXd Free(Eigen::VectorXd whitened) const;
  void WriteFrameGram();
  std::vector<Hill> Select(Linearization& skin, const Eigen::VectorXd* untouched_norms);
  void Eliminate(std::vector<Hill>& hills);
  struct Explanation {
    double chi2 = 0;
    Eigen::VectorXd loads;  // by column, in the hills' order
  };
  /// Also counts it as a trial.
  Explanation Explain(const std::vector<Hill>& hills, size_t without);

  void SetData(const Linearization& skin, const MarkerObservations& observed);
  bool FitColumnsAtHand(Linearization& skin, const Eigen::VectorXd* untouched_norms,
                        const FitOptions& options);
  struct Solution {
    Eigen::VectorXd loads, tangential, residual;
    double chi2 = 0;
    bool converged = true;
  };
  /// Forces around and along, and couples about both.
  static constexpr Eigen::Index kTangential = 4;
  /// Those of the hills' tangential forces, and the shares by site that they were made for.
  struct TangentialColumns {
    Eigen::MatrixXd shares;                // by site, of each hill
    std::vector<Eigen::MatrixXd> columns;  // by hill, whitened, beside what is hidden

    bool AreAbout(const Eigen::MatrixXd& now) const;
  };
  Eigen::MatrixXd SharesOf(const std::vector<Hill>& hills) const;
  void MakeTangentialColumns(const Linearization& skin, Eigen::MatrixXd shares);
  Eigen::VectorXd TangentialPrior(Eigen::Index columns) const;
  Solution Refit(const std::vector<int>& chosen, const Eigen::MatrixXd& tangential);
  void FitWithoutTangential();
  void LetSlip(const Linearization& skin);
  /// What a hill's tangential force would be, and would explain: chi^2.
  struct TangentialGain {
    double chi2 = 0;
    Vec2 force_n = Vec2::Zero();
  };
  std::vector<TangentialGain> TangentialGains(const std::vector<int>& sites,
                                              const Eigen::MatrixXd& tangential,
                                              const Solution& solution) const;
  /// Columns with what they say of themselves.
  struct FitColumns {
    Eigen::MatrixXd columns;
    Eigen::LLT<Eigen::MatrixXd> factor;
  };
  FitColumns ColumnsOf(const std::vector<int>& acting, const Eigen::MatrixXd& tangential) const;
  Eigen::MatrixXd InformationBeside(const FitColumns& fit, const Eigen::MatrixXd& own) const;
  Eigen::MatrixXd ShiftColumns(const Linearization& skin, const EstimatedLoad& load) const;
  void MoveCenters(const Linearization& skin, LoadEstimate& estimate) const;
  void ProjectOut(const Eigen::MatrixXd& tangential);
  void Finish(Linearization& skin, LoadEstimate& estimate);
  void WriteLoad(const Linearization& skin, EstimatedLoad& load) const;
  void WriteCovariances(Linearization& skin, LoadEstimate& estimate);
  void WriteStray(Linearization& skin, LoadEstimate& estimate);
  double WorstRegion(const Eigen::VectorXd& by_cameras_mm);

  const SkinMechanics& mechanics_;
  const Neighborhoods& near_;
  MarkerCovariance covariance_;
  const CameraModes camera_modes_;
  HillFinder hills_;
  NonNegativeSolver solver_;

  // Since Prepare. Whitened: in units of independent standard deviations.
  std::shared_ptr<const UntouchedCovariance> untouched_;
  std::vector<Mat3> noise_mm2_;  // by marker
  Eigen::MatrixXd camera_modes_mm_;
  Whitening whitening_;
  Eigen::Index model_columns_ = 0;                          // of whitening_: that loads and baseline add
  std::vector<Mat3> model_covariance_, camera_covariance_;  // empty: not written since Prepare
  KnownLoadsErrors known_errors_;
  Eigen::MatrixXd by_known_loads_, whitened_known_loads_;  // stacked, by known_errors_
  LoadColumns columns_;
  std::vector<std::vector<int>> regions_;                                   // 3 x 3 markers each
  std::vector<std::optional<Eigen::LLT<Eigen::MatrixXf>>> region_factors_;  // of those asked for
  double usual_norm_ = 0;

  // Of the frame. Hidden: an orthonormal basis of what the frame does not show, whitened, and of the
  // tangential forces that were let in; data and Gram matrix without it.
  std::vector<Direction> missing_, missing_now_;  // what hidden_ is of, and what this frame misses
  Eigen::MatrixXd hidden_;
  Eigen::MatrixXd
      basis_;  // hidden_ and tangential forces, of which shares_ are taken out of data and columns
  Eigen::VectorXd shares_;
  Eigen::MatrixXf hidden_columns_, free_gram_;
  Eigen::Index hidden_projected_ = 0;            // of free_gram_, the columns that are without hidden_ alone
  const Eigen::MatrixXf* frame_gram_ = nullptr;  // the columns', where nothing is hidden
  Eigen::VectorXd free_norms_;                   // empty: not known of what is hidden now
  Eigen::VectorXd data_, frame_data_, loads_;
  Eigen::VectorXd target_;           // by place of a column
  Eigen::VectorXd norms_, weights_;  // by load
  Eigen::VectorXd found_;            // by chosen_
  bool is_selected_ = false;         // by a solver that came to its end
  std::vector<char> is_shown_;       // by row
  int trials_ = 0;                   // of the fit
  DetectionLimits limits_;   // none by site: not known since Prepare, or since other markers are hidden
  std::vector<int> chosen_;  // loads above zero of the last selection
  struct {
    std::vector<Hill> hills;
    std::vector<int> slipping;   // hills with a tangential force, in the order of their columns
    Eigen::MatrixXd tangential;  // columns of those, whitened, beside what is hidden
  } fit_;
  Solution solution_;
  Eigen::VectorXd inward_pulls_;          // by site, of the residual
  Eigen::VectorXd pulls_per_mm_;          // of the residual, on each marker: covariance^-1 times it
  std::vector<TangentialGain> left_out_;  // by hill: of those that were not let in
  TangentialColumns tangential_;          // none: not made since Prepare, or since other markers are hidden
  std::vector<size_t> hill_of_load_;      // by load of the estimate
};

}  // namespace taclink
