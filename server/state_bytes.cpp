#include "server/state_bytes.h"

#include <vector>

namespace taclink::server {
namespace {

template <typename T>
size_t Bytes(const std::vector<T>& buffer) {
  return buffer.capacity() * sizeof(T);
}

}  // namespace

size_t StateBytes(const LinkState& state) {
  size_t bytes = sizeof state + state.status_reason.capacity();
  bytes += Bytes(state.shape.positions_mm) + Bytes(state.shape.displacements_mm) +
           Bytes(state.shape.covariances_mm2) + Bytes(state.shape.sources) + Bytes(state.shape.measured) +
           Bytes(state.shape.rejected);
  bytes += Bytes(state.forces.forces_n) + Bytes(state.forces.sigmas_n) + Bytes(state.forces.loaded) +
           Bytes(state.forces.limits_n);
  bytes += Bytes(state.contacts);
  for (const Contact& contact : state.contacts) bytes += Bytes(contact.markers);
  return bytes;
}

}  // namespace taclink::server
