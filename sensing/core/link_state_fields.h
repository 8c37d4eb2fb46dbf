#pragma once

#include <concepts>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "sensing/core/link_state.h"

// The one list of the fields of a LinkState. What has to treat every field alike (clearing, size in memory,
// the test of the codec) visits this list. Each structured binding names all members of its struct: a new
// member does not compile until it is added here.
namespace taclink {

template <typename S, typename T>
concept Is = std::same_as<std::remove_const_t<S>, T>;

/// What a field tells about: the frame itself, or what was measured in it.
enum class FieldScope { kFrame, kMeasurement };

template <typename T>
struct Field {
  const char* name;
  T& value;
  FieldScope scope = FieldScope::kFrame;
};
template <typename T>
Field(const char*, T&) -> Field<T>;
template <typename T>
Field<T> Measured(const char* name, T& value) {
  return {name, value, FieldScope::kMeasurement};
}

template <Is<SkinShape> S>
auto Fields(S& shape) {
  auto& [positions_mm, displacements_mm, covariances_mm2, sources, measured, rejected] = shape;
  return std::tuple(Field{"positions_mm", positions_mm}, Field{"displacements_mm", displacements_mm},
                    Field{"covariances_mm2", covariances_mm2}, Field{"sources", sources},
                    Field{"measured", measured}, Field{"rejected", rejected});
}

template <Is<NodalForces> S>
auto Fields(S& forces) {
  auto& [model, forces_n, sigmas_n, loaded, limits_n, limit_around_n, residual, region_residual,
         camera_shift_mm, converged] = forces;
  return std::tuple(Field{"model", model}, Field{"forces_n", forces_n}, Field{"sigmas_n", sigmas_n},
                    Field{"loaded", loaded}, Field{"limits_n", limits_n},
                    Field{"limit_around_n", limit_around_n}, Field{"residual", residual},
                    Field{"region_residual", region_residual}, Field{"camera_shift_mm", camera_shift_mm},
                    Field{"converged", converged});
}

template <Is<Contact> S>
auto Fields(S& contact) {
  auto& [id, is_ring_contact, center_mm, normal, force_n, force_covariance_n2, center_covariance_mm2,
         normal_force_n, area_mm2, markers, moment_nmm, peak_pressure_mpa, major_axis_mm, minor_axis_mm,
         outline_mm] = contact;
  return std::tuple(
      Field{"id", id}, Field{"is_ring_contact", is_ring_contact}, Field{"center_mm", center_mm},
      Field{"normal", normal}, Field{"force_n", force_n}, Field{"force_covariance_n2", force_covariance_n2},
      Field{"center_covariance_mm2", center_covariance_mm2}, Field{"normal_force_n", normal_force_n},
      Field{"area_mm2", area_mm2}, Field{"markers", markers}, Field{"moment_nmm", moment_nmm},
      Field{"peak_pressure_mpa", peak_pressure_mpa}, Field{"major_axis_mm", major_axis_mm},
      Field{"minor_axis_mm", minor_axis_mm}, Field{"outline_mm", outline_mm});
}

template <Is<Reason> S>
auto Fields(S& reason) {
  auto& [id, text, value, limit] = reason;
  return std::tuple(Field{"id", id}, Field{"text", text}, Field{"value", value}, Field{"limit", limit});
}

template <Is<PressureReport> S>
auto Fields(S& pressure) {
  auto& [origin, stale, mpa, age_ns, trouble] = pressure;
  return std::tuple(Field{"origin", origin}, Field{"stale", stale}, Field{"mpa", mpa},
                    Field{"age_ns", age_ns}, Field{"trouble", trouble});
}

template <Is<SpecificForceReading> S>
auto Fields(S& reading) {
  auto& [mps2, covariance, origin, trouble] = reading;
  return std::tuple(Field{"mps2", mps2}, Field{"covariance", covariance}, Field{"origin", origin},
                    Field{"trouble", trouble});
}

template <Is<AppliedContact> S>
auto Fields(S& contact) {
  auto& [body_id, center_mm, normal, force_n, depth_mm] = contact;
  return std::tuple(Field{"body_id", body_id}, Field{"center_mm", center_mm}, Field{"normal", normal},
                    Field{"force_n", force_n}, Field{"depth_mm", depth_mm});
}

template <Is<SimulationReport> S>
auto Fields(S& simulation) {
  auto& [contacts, trouble] = simulation;
  return std::tuple(Field{"contacts", contacts}, Field{"trouble", trouble});
}

template <Is<Baseline> S>
auto Fields(S& baseline) {
  auto& [origin, taken_utc_ns, calibrated_utc_ns, drift_mm, drift_state, missing_markers] = baseline;
  return std::tuple(Field{"origin", origin}, Field{"taken_utc_ns", taken_utc_ns},
                    Field{"calibrated_utc_ns", calibrated_utc_ns}, Field{"drift_mm", drift_mm},
                    Field{"drift_state", drift_state}, Field{"missing_markers", missing_markers});
}

template <Is<LinkState> S>
auto Fields(S& state) {
  auto& [sequence, times, status, status_reason, reasons, pressure_mpa, pressure, pressure_estimate,
         specific_force, specific_force_estimate, cameras, tracking, shape, forces, contacts, total_force_n,
         baseline_age_s, baseline, stage_ms, simulation, replayed] = state;
  return std::tuple(
      Field{"sequence", sequence}, Field{"times", times}, Field{"status", status},
      Field{"status_reason", status_reason}, Field{"reasons", reasons}, Field{"pressure_mpa", pressure_mpa},
      Field{"pressure", pressure}, Measured("pressure_estimate", pressure_estimate),
      Field{"specific_force", specific_force}, Measured("specific_force_estimate", specific_force_estimate),
      Field{"cameras", cameras}, Field{"tracking", tracking}, Measured("shape", shape),
      Measured("forces", forces), Measured("contacts", contacts), Measured("total_force_n", total_force_n),
      Field{"baseline_age_s", baseline_age_s}, Field{"baseline", baseline}, Field{"stage_ms", stage_ms},
      Field{"simulation", simulation}, Field{"replayed", replayed});
}

template <typename T>
concept HasFields = requires(T& value) { Fields(value); };

/// `visit(name, member)` for each member in order.
template <HasFields S, typename Visitor>
void VisitFields(S& value, Visitor&& visit) {
  std::apply([&](const auto&... field) { (visit(field.name, field.value), ...); }, Fields(value));
}

template <typename T>
inline constexpr bool kIsVector = false;
template <typename T>
inline constexpr bool kIsVector<std::vector<T>> = true;
template <typename T>
inline constexpr bool kIsOptional = false;
template <typename T>
inline constexpr bool kIsOptional<std::optional<T>> = true;

/// `field` becomes `initial`, whose vectors and strings are empty; those of `field` keep their buffers.
template <typename T>
void ResetField(T& field, const T& initial) {
  if constexpr (HasFields<T>) {
    const auto targets = Fields(field);
    const auto values = Fields(initial);
    [&]<size_t... I>(std::index_sequence<I...>) {
      (ResetField(std::get<I>(targets).value, std::get<I>(values).value), ...);
    }(std::make_index_sequence<std::tuple_size_v<decltype(targets)>>());
  } else if constexpr (kIsVector<T> || std::same_as<T, std::string>) {
    field.clear();
  } else {
    field = initial;
  }
}

/// All fields of `scope` back to their defaults; buffers stay.
inline void ResetFields(LinkState& state, FieldScope scope) {
  const LinkState initial;
  const auto targets = Fields(state);
  const auto values = Fields(initial);
  const auto reset = [scope](const auto& target, const auto& value) {
    if (target.scope == scope) ResetField(target.value, value.value);
  };
  [&]<size_t... I>(std::index_sequence<I...>) {
    (reset(std::get<I>(targets), std::get<I>(values)), ...);
  }(std::make_index_sequence<std::tuple_size_v<decltype(targets)>>());
}

}  // namespace taclink
