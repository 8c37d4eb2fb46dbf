#include "sensing/simulation/truth_json.h"

#include <cmath>
#include <cstdio>

namespace taclink {
namespace {

// A micrometre and a micronewton are finer than anything that is measured here.
void Write(double value, std::ostream& out) {
  char text[32];
  const double rounded = std::round(value * 1e6) / 1e6 + 0.0;  // + 0.0: no -0
  const int length = std::snprintf(text, sizeof(text), "%.10g", rounded);
  out.write(text, length);
}

void Write(const Vec3& v, std::ostream& out) {
  out << '[';
  Write(v.x(), out);
  out << ',';
  Write(v.y(), out);
  out << ',';
  Write(v.z(), out);
  out << ']';
}

template <typename Items, typename WriteItem>
void WriteList(const Items& items, std::ostream& out, const WriteItem& write) {
  out << '[';
  for (size_t i = 0; i < items.size(); ++i) {
    if (i > 0) out << ',';
    write(i);
  }
  out << ']';
}

void Write(const TrueContact& contact, std::ostream& out) {
  out << "{\"center_mm\":";
  Write(contact.center_mm, out);
  out << ",\"normal\":";
  Write(contact.normal, out);
  out << ",\"force_n\":";
  Write(contact.force_n, out);
  out << ",\"depth_mm\":";
  Write(contact.depth_mm, out);
  out << ",\"patch_diameter_mm\":";
  Write(contact.patch_diameter_mm, out);
  out << ",\"limited\":" << (contact.limited ? "true" : "false") << '}';
}

}  // namespace

void WriteTruthLine(const SkinTruth& truth, const std::vector<Vec3>& rest_markers_mm, std::ostream& out) {
  out << "{\"frame\":" << truth.frame << ",\"time_s\":";
  Write(truth.time_s, out);
  out << ",\"pressure_kpa\":";
  Write(truth.pressure_mpa * 1e3, out);
  out << ",\"specific_force_mps2\":";
  Write(truth.specific_force_mps2, out);
  out << ",\"contacts\":";
  WriteList(truth.contacts, out, [&](size_t i) { Write(truth.contacts[i], out); });
  out << ",\"total_force_n\":";
  Write(truth.total_force_n, out);
  out << ",\"markers_mm\":";
  WriteList(truth.marker_mm, out, [&](size_t i) { Write(truth.marker_mm[i], out); });
  out << ",\"displacements_mm\":";
  WriteList(truth.marker_mm, out,
            [&](size_t i) { Write(Vec3(truth.marker_mm[i] - rest_markers_mm[i]), out); });
  out << "}\n";
}

}  // namespace taclink
