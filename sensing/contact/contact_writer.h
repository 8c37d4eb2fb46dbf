#pragma once

#include "sensing/core/contact.h"
#include "sensing/estimation/skin_estimator.h"

namespace taclink {

/// What the estimator's loads are on the skin: points, normals, pressures. For one estimate.
class ContactWriter {
 public:
  ContactWriter(SkinEstimator& estimator, const SkinEstimate& estimate);

  /// All but the id.
  void Write(const EstimatedLoad& load, Contact& contact);
  /// Adds the load to the nearest markers, so that force and first moment on the grid are kept.
  void Lump(const EstimatedLoad& load, NodalForces& forces);

 private:
  struct SiteLoad {
    int site = 0;
    double inward_n = 0;
    Vec3 force_n = Vec3::Zero();
  };
  void Spread(const EstimatedLoad& load);
  Vec3 OuterPoint(int site) const;
  Vec3 OuterPointAt(double column, double row) const;
  int FromOrigin(int site) const;
  void WriteShape(const EstimatedLoad& load, Contact& contact);
  void WriteOutline(Contact& contact);  // a convex hull [andrew1979]
  void WriteMarkers(Contact& contact) const;

  const SkinMechanics& mechanics_;
  const Linearization& skin_;
  const SkinEstimate& estimate_;
  std::vector<SiteLoad> spread_;
  int origin_ = 0;  // column from which others are counted, so that a load over the seam has a middle
  double peak_mpa_ = 0;
};

}  // namespace taclink
