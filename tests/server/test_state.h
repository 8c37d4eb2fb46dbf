#pragma once

#include <cstdint>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// A state whose every number follows from link and sequence.
inline void FillTestState(size_t link, uint64_t sequence, LinkState& state) {
  constexpr size_t kMarkers = 256;
  const auto number = static_cast<double>(sequence);
  state.sequence = sequence;
  state.status = LinkStatus::kOk;
  state.status_reason.clear();
  state.pressure_mpa = 0.001 * number;
  state.shape.positions_mm.assign(kMarkers, Vec3(number, static_cast<double>(link), 3));
  state.shape.displacements_mm.assign(kMarkers, Vec3(0, 0, number));
  state.shape.covariances_mm2.assign(kMarkers, Mat3::Identity());
  state.shape.sources.assign(kMarkers, MarkerSource::kBoth);
  state.forces.forces_n.assign(kMarkers, Vec3(0.5, 0, 0));
  state.forces.sigmas_n.assign(kMarkers, 0.25);
  Contact contact;
  contact.id = 7;
  contact.center_mm = Vec3(36.5, 0, number);
  contact.normal = Vec3::UnitX();
  contact.force_n = Vec3(-0.1 * number, 0, 0);
  contact.normal_force_n = 0.1 * number;
  contact.area_mm2 = 100;
  state.contacts.assign(1, contact);
  state.total_force_n = contact.force_n;
}

}  // namespace taclink::server
