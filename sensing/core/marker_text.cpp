#include "sensing/core/marker_text.h"

#include <algorithm>
#include <map>
#include <set>

namespace taclink {
namespace {

constexpr size_t kMostPathsListed = 8;

// "ring 4", "rings 1, 4 to 6".
std::string RingText(const std::set<int>& rings) {
  std::string text;
  for (auto ring = rings.begin(); ring != rings.end();) {
    const int first = *ring;
    int last = first;
    while (++ring != rings.end() && *ring == last + 1) ++last;
    text += (text.empty() ? "" : ", ") + std::to_string(first);
    if (last > first) text += " to " + std::to_string(last);
  }
  return (rings.size() == 1 ? "ring " : "rings ") + text;
}

}  // namespace

std::string MarkerText(std::span<const int> markers, int paths) {
  std::map<int, std::set<int>> rings_of;
  for (const int marker : markers) rings_of[marker % paths + 1].insert(marker / paths + 1);
  std::string text;
  size_t listed = 0, markers_listed = 0;
  for (const auto& [path, rings] : rings_of) {
    if (listed++ == kMostPathsListed)
      return text + "; and " + std::to_string(markers.size() - markers_listed) + " more";
    text += (text.empty() ? "path " : "; path ") + std::to_string(path) + ", " + RingText(rings);
    markers_listed += rings.size();
  }
  return text;
}

}  // namespace taclink
