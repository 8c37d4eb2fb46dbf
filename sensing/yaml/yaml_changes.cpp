#include "sensing/yaml/yaml_changes.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <utility>

namespace taclink {
namespace {

using Members = std::vector<std::pair<std::string, YAML::Node>>;

Members MembersOf(const YAML::Node& node) {
  Members out;
  size_t number = 0;
  for (const auto& item : node) {
    if (node.IsMap()) {
      out.emplace_back(item.first.as<std::string>(), item.second);
      continue;
    }
    ++number;
    const YAML::Node name = item.IsMap() ? item["name"] : YAML::Node(YAML::NodeType::Undefined);
    out.emplace_back(name && name.IsScalar() ? name.as<std::string>() : std::to_string(number), item);
  }
  return out;
}

YAML::Node FindIn(const Members& members, const std::string& name) {
  const auto at =
      std::find_if(members.begin(), members.end(), [&](const auto& member) { return member.first == name; });
  return at == members.end() ? YAML::Node(YAML::NodeType::Undefined) : at->second;
}

void Compare(const std::string& path, const YAML::Node& before, const YAML::Node& after,
             std::vector<std::string>& out) {
  const auto is_plain_list = [](const YAML::Node& node) {
    return node && node.IsSequence() &&
           std::none_of(node.begin(), node.end(), [](const YAML::Node& item) { return item.IsMap(); });
  };
  const bool both = before && after && before.Type() == after.Type();
  if (!both || before.IsScalar() || is_plain_list(before) || is_plain_list(after)) {
    if (!both || YAML::Dump(before) != YAML::Dump(after)) out.push_back(path);
    return;
  }
  const Members old = MembersOf(before), now = MembersOf(after);
  const auto below = [&](const std::string& name) { return path.empty() ? name : path + "." + name; };
  for (const auto& [name, node] : old) Compare(below(name), node, FindIn(now, name), out);
  for (const auto& [name, node] : now)
    if (!FindIn(old, name)) out.push_back(below(name));
}

}  // namespace

std::vector<std::string> ChangedKeys(const std::string& before, const std::string& after) {
  std::vector<std::string> out;
  Compare("", YAML::Load(before), YAML::Load(after), out);
  return out;
}

}  // namespace taclink
