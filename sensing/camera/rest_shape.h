#pragma once

#include <Eigen/Core>
#include <utility>

#include "sensing/core/link_model.h"

namespace taclink {

/// Where a link's markers are in its rest images: on the undeformed skin, displaced by the known loads under
/// which the images are taken (pressure, weight). Refers to the model.
class RestShape {
 public:
  /// An undeformed skin. Implicit, for it is the usual case of a function that takes a rest shape.
  RestShape(const LinkModel& model) : model_(&model) {}  // NOLINT(google-explicit-constructor)
  /// `displaced_mm`: stacked markers, link frame. `errors_mm`: likewise, what independent errors of the known
  /// loads do, of one standard deviation each, a column for each; empty: the loads are exact.
  explicit RestShape(const LinkModel& model, Eigen::VectorXd displaced_mm, Eigen::MatrixXd errors_mm = {})
      : model_(&model), displaced_mm_(std::move(displaced_mm)), errors_mm_(std::move(errors_mm)) {}

  const LinkModel& model() const { return *model_; }
  Vec3 Displacement(int marker) const {
    return displaced_mm_.size() == 0 ? Vec3::Zero() : Vec3(displaced_mm_.segment<3>(3 * marker));
  }
  const Eigen::MatrixXd& errors_mm() const { return errors_mm_; }
  /// Normal of the wall under a marker, by those around it.
  Vec3 Inward(int marker) const;
  Vec3 Marker(int marker) const { return model_->RestMarker(marker) + Displacement(marker); }

 private:
  const LinkModel* model_;
  Eigen::VectorXd displaced_mm_;  // empty: none
  Eigen::MatrixXd errors_mm_;
};

}  // namespace taclink
