#include "server/assembly/reload.h"

#include <algorithm>
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

void Reloader::Add(const std::string& section, Apply apply, std::vector<std::string> fixed) {
  const std::lock_guard lock(mutex_);
  sections_.push_back({section, std::move(apply), std::move(fixed)});
}

void Reloader::AddAlways(const std::string& what, Apply apply) {
  const std::lock_guard lock(mutex_);
  always_.push_back({what, std::move(apply)});
}

Reloader::Outcome Reloader::Reload(const Config& next) {
  const std::lock_guard lock(mutex_);
  Outcome outcome;
  const auto before = Sections(running_);
  std::string running;
  const std::string next_text = ConfigText(next);
  outcome.keys = ChangedKeys(std::exchange(last_, next_text), next_text);
  const auto after = Sections(next_text);
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
  for (const std::string& name : names) {
    const std::string old_text = text_in(before, name), text = text_in(after, name);
    if (text == old_text) {
      running += text;
      continue;
    }
    const auto hook =
        std::find_if(sections_.begin(), sections_.end(), [&](const Hook& h) { return h.name == name; });
    if (hook == sections_.end()) {
      outcome.needs_restart.push_back(name);
      running += old_text;
      continue;
    }
    const auto applied = hook->apply(next);
    if (applied) {
      outcome.applied.push_back(name);
      for (const std::string& key : ChangedKeys(old_text, text)) {
        const auto is_key = [&](const std::string& fixed) { return key == name + "." + fixed; };
        if (std::ranges::any_of(hook->fixed, is_key)) outcome.needs_restart.push_back(key);
      }
    } else {
      outcome.errors.push_back(name + ": " + applied.error().message);
    }
    running += applied ? text : old_text;
  }
  running_ = running;
  for (const Hook& hook : always_) {
    const auto applied = hook.apply(next);
    if (!applied) outcome.errors.push_back(hook.name + ": " + applied.error().message);
  }
  return outcome;
}

}  // namespace taclink::server
