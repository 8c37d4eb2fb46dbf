#include "server/assembly/reload.h"

#include <algorithm>
#include <cassert>
#include <sstream>
#include <utility>

#include "sensing/yaml/yaml_changes.h"

namespace taclink::server {

std::vector<std::pair<std::string, std::string>> Sections(const std::string& config_text) {
  std::vector<std::pair<std::string, std::string>> sections;
  std::istringstream in(config_text);
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line[0] != ' ') sections.emplace_back(line.substr(0, line.find(':')), "");
    if (!sections.empty()) sections.back().second += line + "\n";
  }
  return sections;
}

Reloader::Reloader(const Config& running) : running_(ConfigText(running)), last_(running_) {}

void Reloader::Add(const std::string& section, Apply apply, std::vector<std::string> fixed, When when) {
  const std::lock_guard lock(mutex_);
  assert(std::ranges::find(sections_, section, &Hook::name) == sections_.end());
  sections_.push_back({section, std::move(apply), std::move(fixed), when});
}

void Reloader::AddAlways(const std::string& what, Apply apply) {
  const std::lock_guard lock(mutex_);
  always_.push_back({what, std::move(apply)});
}

const std::string& Reloader::TakeOver(const Change& change, const Config& next, Outcome& outcome) const {
  const bool changed = change.before != change.after;
  const auto hook = std::ranges::find(sections_, change.section, &Hook::name);
  if (hook == sections_.end()) {
    if (changed) outcome.needs_restart.push_back(change.section);
    return change.before;
  }
  if (!changed && hook->when == When::kChanged) return change.before;
  if (const auto applied = hook->apply(next); !applied) {
    outcome.errors.push_back(change.section + ": " + applied.error().message);
    return change.before;
  }
  if (!changed) return change.before;
  outcome.applied.push_back(change.section);
  for (const std::string& key : ChangedKeys(change.before, change.after)) {
    const auto is_key = [&](const std::string& fixed) { return key == change.section + "." + fixed; };
    if (std::ranges::any_of(hook->fixed, is_key)) outcome.needs_restart.push_back(key);
  }
  return change.after;
}

Reloader::Outcome Reloader::Reload(const Config& next) {
  const std::lock_guard lock(mutex_);
  Outcome outcome;
  const std::string next_text = ConfigText(next);
  outcome.keys = ChangedKeys(std::exchange(last_, next_text), next_text);
  const auto before = Sections(running_), after = Sections(next_text);
  // A section that is not there is an empty one.
  const auto text_in = [](const auto& sections, const std::string& name) {
    const auto at =
        std::find_if(sections.begin(), sections.end(), [&](const auto& s) { return s.first == name; });
    return at == sections.end() ? std::string() : at->second;
  };
  std::vector<std::string> names;
  for (const auto* sections : {&before, &after}) {
    for (const auto& [name, text] : *sections) {
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  std::string running;
  for (const std::string& name : names) {
    const Change change{.section = name, .before = text_in(before, name), .after = text_in(after, name)};
    running += TakeOver(change, next, outcome);
  }
  running_ = running;
  for (const Hook& hook : always_) {
    const auto applied = hook.apply(next);
    if (!applied) outcome.errors.push_back(hook.name + ": " + applied.error().message);
  }
  return outcome;
}

}  // namespace taclink::server
