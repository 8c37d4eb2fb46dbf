#include "server/messages/history_message.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <span>

namespace taclink::server {
namespace {

constexpr double kUsualSpanS = 60, kNsPerS = 1e9;
constexpr int64_t kApartNs = 1'000'000'000;

int64_t NewestNs(const v1::ContactForceHistory& contact, const v1::LinkForceHistory& link) {
  return link.exposure_utc_ns(static_cast<int>(*contact.samples().rbegin()));
}

void Fill(const std::vector<ForceSample>& samples, v1::LinkForceHistory& out) {
  std::map<uint64_t, v1::ContactForceHistory*> contacts;
  for (size_t i = 0; i < samples.size(); ++i) {
    out.add_exposure_utc_ns(samples[i].exposure_utc_ns);
    out.add_total_magnitude_n(static_cast<float>(samples[i].total_n));
    for (const auto& [id, magnitude_n] : std::span(samples[i].contacts_n).first(samples[i].contacts)) {
      v1::ContactForceHistory*& contact = contacts[id];
      // A link that was started again numbers its contacts from 1.
      const bool is_other =
          contact != nullptr && samples[i].exposure_utc_ns - NewestNs(*contact, out) > kApartNs;
      if (contact == nullptr || is_other) (contact = out.add_contacts())->set_id(id);
      contact->add_samples(static_cast<uint32_t>(i));
      contact->add_magnitude_n(static_cast<float>(magnitude_n));
    }
  }
}

}  // namespace

void Fill(Arm& arm, const std::vector<bool>& wanted, double span_s, v1::GetForceHistoryResponse& out) {
  const auto span_ns = static_cast<int64_t>(kNsPerS * (span_s > 0 ? span_s : kUsualSpanS));
  for (size_t link = 0; link < arm.links().size(); ++link) {
    if (!wanted.empty() && !wanted[link]) continue;
    const ForceHistory& forces = arm.worker(link).forces();
    v1::LinkForceHistory& history = *out.add_links();
    history.set_link(arm.links()[link].name);
    Fill(forces.Since(forces.newest_utc_ns() - span_ns), history);
  }
}

}  // namespace taclink::server
