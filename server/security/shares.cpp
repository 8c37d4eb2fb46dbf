#include "server/security/shares.h"

namespace taclink::server {

Error Shares::Refusal(const std::string& what, const char* setting) const {
  const std::string raise = setting[0] == '\0' ? "" : std::string(" or raise ") + setting;
  return {ErrorCode::kResourceExhausted, what + "; " + words_.remedy + raise};
}

Result<void> Shares::Take(const Party& party) {
  const std::string things = words_.things;
  if (taken_ >= limits_.all)
    return Refusal("all " + std::to_string(limits_.all) + " " + things + " are in use", words_.all_setting);
  const size_t kept = Kept(limits_.all);
  if (!party.preferred && taken_by_others_ >= limits_.all - kept)
    return Refusal("the last " + std::to_string(kept) + " " + things +
                       " are kept for callers on this machine or with a token or certificate",
                   words_.all_setting);
  if (!party.who.empty()) {
    const auto used = by_party_.find(party.who);
    if (used != by_party_.end() && used->second >= limits_.per_party)
      return Refusal(
          "all " + std::to_string(limits_.per_party) + " " + things + " of " + party.who + " are in use",
          words_.party_setting);
    ++by_party_[party.who];
  }
  ++taken_;
  if (!party.preferred) ++taken_by_others_;
  return {};
}

void Shares::Give(const Party& party) {
  --taken_;
  if (!party.preferred) --taken_by_others_;
  const auto used = by_party_.find(party.who);
  if (used != by_party_.end() && --used->second == 0) by_party_.erase(used);
}

}  // namespace taclink::server
