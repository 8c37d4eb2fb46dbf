#include "sensing/design/findings.h"

namespace taclink {

const char* Name(Severity severity) {
  switch (severity) {
    case Severity::kNote:
      return "note";
    case Severity::kWarning:
      return "warning";
    case Severity::kFault:
      return "fault";
  }
  return "";
}

Finding AtMarker(const LinkModel& model, int marker, Finding finding) {
  finding.path = model.PathOf(marker) + 1;
  finding.ring = model.RingOf(marker) + 1;
  finding.z_mm = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(marker))];
  return finding;
}

}  // namespace taclink
