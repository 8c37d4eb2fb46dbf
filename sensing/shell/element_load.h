#pragma once

#include <span>

#include "sensing/shell/nonlinear_element.h"

namespace taclink {

/// A load that has an energy, element by element: a pressure, a contact.
class ElementLoad {
 public:
  virtual ~ElementLoad() = default;
  /// Adds its energy, and its derivatives up to `order`, at an element's state.
  virtual void Add(DerivativeOrder order, int element, const ElementState& state,
                   ElementResponse& response) const = 0;
  /// Not zero: the load is this FollowerPressure on all elements alike, which a shell may apply by itself
  /// instead of by Add.
  virtual double uniform_pressure_mpa() const { return 0; }

 protected:
  ElementLoad() = default;
  ElementLoad(const ElementLoad&) = default;
  ElementLoad& operator=(const ElementLoad&) = default;
};

/// Gauge pressure inside the skin, on its deformed area. Silicone is incompressible: the inner half of the
/// wall keeps its volume, so the volume inside the inner wall changes as that inside the mid-surface does,
/// and the pressure does its work there (on the inner wall's smaller area a skin would grow 5 to 7 % too
/// little). Its energy is minus pressure times the volume between the mid-surface and the link frame's
/// origin; for a skin whose rim stands still that is exact up to a constant, so that the load has a potential
/// and its tangent is symmetric [schweizerhof1984].
class FollowerPressure final : public ElementLoad {
 public:
  explicit FollowerPressure(double pressure_mpa) : pressure_mpa_(pressure_mpa) {}
  void Add(DerivativeOrder order, int element, const ElementState& state,
           ElementResponse& response) const override;
  double uniform_pressure_mpa() const override { return pressure_mpa_; }

 private:
  double pressure_mpa_;
};

/// A FollowerPressure as the loads of a shell; none where it is zero.
class PressureLoads {
 public:
  explicit PressureLoads(double pressure_mpa) : pressure_(pressure_mpa), is_any_(pressure_mpa != 0) {}
  PressureLoads(const PressureLoads&) = delete;
  PressureLoads& operator=(const PressureLoads&) = delete;
  std::span<const ElementLoad* const> loads() const { return {&one_, is_any_ ? 1U : 0U}; }

 private:
  FollowerPressure pressure_;
  const ElementLoad* one_ = &pressure_;
  bool is_any_;
};

}  // namespace taclink
