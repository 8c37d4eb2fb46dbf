#include "server/arm/link_names.h"

#include <algorithm>

namespace taclink::server {

Result<size_t> FindLink(const std::vector<std::string>& link_names, const std::string& name) {
  const auto at = std::find(link_names.begin(), link_names.end(), name);
  if (at != link_names.end()) return static_cast<size_t>(at - link_names.begin());
  std::string known;
  for (const auto& link : link_names) known += (known.empty() ? "" : ", ") + link;
  return Error{ErrorCode::kNotFound, "no link '" + name + "'; this arm has " + known};
}

}  // namespace taclink::server
