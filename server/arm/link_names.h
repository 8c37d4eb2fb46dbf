#pragma once

#include <string>
#include <vector>

#include "sensing/core/result.h"

namespace taclink::server {

/// Place of a link among `link_names`. Errors: kNotFound, with the names there are.
Result<size_t> FindLink(const std::vector<std::string>& link_names, const std::string& name);

/// Which of `link_names` are among `names`; none of them: empty, for all. Errors as FindLink.
template <typename Names>
Result<std::vector<bool>> FindLinks(const std::vector<std::string>& link_names, const Names& names) {
  std::vector<bool> wanted;
  for (const std::string& name : names) {
    const auto link = FindLink(link_names, name);
    if (!link) return link.error();
    wanted.resize(link_names.size(), false);
    wanted[*link] = true;
  }
  return wanted;
}

}  // namespace taclink::server
