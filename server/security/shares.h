#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "sensing/core/result.h"
#include "server/security/party.h"

namespace taclink::server {

struct ShareLimits {
  size_t all = 0;
  size_t per_party = 0;
};

/// Of a limited number of places this part is kept for preferred parties.
constexpr size_t Kept(size_t places) {
  return places / 4;
}

/// What is given out, for refusals: "streams", and where its limits are set; no setting: "".
struct ShareWords {
  const char* things;
  const char* all_setting;
  const char* party_setting;
  const char* remedy = "close one";
};

/// Gives out a limited number of places, so that no party takes all and preferred ones find some free.
/// Guarded by its owner.
class Shares {
 public:
  Shares(const ShareLimits& limits, const ShareWords& words) : limits_(limits), words_(words) {}

  /// Errors: kResourceExhausted (which limit, and what to do).
  Result<void> Take(const Party& party);
  /// Back what was taken.
  void Give(const Party& party);
  /// What was taken stays so.
  void SetLimits(const ShareLimits& limits) { limits_ = limits; }
  bool Holds(const Party& party) const { return by_party_.contains(party.who); }

 private:
  Error Refusal(const std::string& what, const char* setting) const;

  ShareLimits limits_;
  const ShareWords words_;
  size_t taken_ = 0;
  size_t taken_by_others_ = 0;  // who are not preferred
  std::map<std::string, size_t> by_party_;
};

}  // namespace taclink::server
