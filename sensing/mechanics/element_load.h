#pragma once

#include "sensing/mechanics/nonlinear_element.h"

namespace taclink {

/// A load that has an energy, element by element: a pressure, a contact.
class ElementLoad {
 public:
  virtual ~ElementLoad() = default;
  /// Adds its energy, and its derivatives up to `order`, at an element's state.
  virtual void Add(DerivativeOrder order, int element, const ElementState& state,
                   ElementResponse& response) const = 0;

 protected:
  ElementLoad() = default;
  ElementLoad(const ElementLoad&) = default;
  ElementLoad& operator=(const ElementLoad&) = default;
};

/// Gauge pressure on the inner wall, on its deformed area. Its energy is minus pressure times the volume
/// between the wall and the link frame's origin; for a skin whose rim stands still that is exact up to a
/// constant, so that the load has a potential and its tangent is symmetric.
class FollowerPressure final : public ElementLoad {
 public:
  FollowerPressure(double thickness_mm, double pressure_mpa)
      : half_thickness_mm_(thickness_mm / 2), pressure_mpa_(pressure_mpa) {}
  void Add(DerivativeOrder order, int element, const ElementState& state,
           ElementResponse& response) const override;

 private:
  double half_thickness_mm_, pressure_mpa_;
};

}  // namespace taclink
