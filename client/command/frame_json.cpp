#include "client/command/frame_json.h"

#include "client/command/json.h"

namespace taclink::command {
namespace {

constexpr double kMmPerMetre = 1e3;
constexpr double kMm2PerSquareMetre = 1e6;
constexpr double kKpaPerPascal = 1e-3;

void WriteContact(JsonWriter& json, const client::Contact& contact) {
  json.Begin('{').Field("id", contact.id).Field("center_mm", contact.center_m, kMmPerMetre);
  json.Field("normal", contact.normal).Field("force_n", contact.force_n).Key("force_sigma_n");
  if (contact.force_sigma_n) {
    json.Value(*contact.force_sigma_n);
  } else {
    json.Null();
  }
  json.Field("normal_force_n", contact.normal_force_n)
      .Field("area_mm2", contact.area_m2 * kMm2PerSquareMetre)
      .End('}');
}

void WriteVectors(JsonWriter& json, const char* key, const std::vector<client::Vector3>& vectors,
                  double scale) {
  if (vectors.empty()) return;
  json.Key(key).Begin('[');
  for (const auto& vector : vectors) json.Value(vector, scale);
  json.End(']');
}

}  // namespace

std::string FrameJson(const client::Frame& frame) {
  JsonWriter json;
  json.Begin('{').Field("link", frame.link).Field("sequence", frame.sequence);
  json.Field("exposure_utc_ns", frame.times.exposure_utc_ns).Key("latency_ms");
  if (const auto latency = frame.latency_s()) {
    json.Value(*latency * 1e3);
  } else {
    json.Null();
  }
  json.Field("status", client::Name(frame.status)).Field("reason", frame.status_reason).Key("pressure_kpa");
  if (frame.pressure_pa) {
    json.Value(*frame.pressure_pa * kKpaPerPascal);
  } else {
    json.Null();
  }
  json.Field("force_model", client::Name(frame.force_model));
  json.Key("markers")
      .Begin('{')
      .Field("seen", frame.markers_seen)
      .Field("inferred", frame.markers_inferred)
      .End('}');
  json.Key("contacts").Begin('[');
  for (const auto& contact : frame.contacts) WriteContact(json, contact);
  json.End(']').Field("total_force_n", frame.total_force_n);
  WriteVectors(json, "positions_mm", frame.positions_m, kMmPerMetre);
  WriteVectors(json, "displacements_mm", frame.displacements_m, kMmPerMetre);
  WriteVectors(json, "nodal_forces_n", frame.nodal_forces_n, 1);
  return json.End('}').text();
}

}  // namespace taclink::command
