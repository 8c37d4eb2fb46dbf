#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "taclink/v1/frame.pb.h"

/// Magnitudes of contacts, as taclink.v1.Contact defines them.
namespace taclink::wire {

/// Of a v1::Contact or a v1::ContactEvent, N.
template <typename ContactMessage>
double MagnitudeN(const ContactMessage& contact) {
  const v1::Vector3& force_n = contact.force_n();
  return std::max(contact.normal_force_n(), std::hypot(force_n.x(), force_n.y(), force_n.z()));
}

/// Sum over the contacts, N; NaN: the forces are not known.
inline double TotalMagnitudeN(const v1::LinkFrame& frame) {
  if (!frame.has_total_force_n()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0;
  for (const v1::Contact& contact : frame.contacts()) sum += MagnitudeN(contact);
  return sum;
}

}  // namespace taclink::wire
