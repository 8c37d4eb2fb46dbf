#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdio>
#include <functional>

#include "sensing/core/read_file.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr const char* kVersion = "2";

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  }
  return quoted + "\"";
}

std::string NumbersText(const char* format, double number) {
  char text[32];
  std::snprintf(text, sizeof text, format, number);
  return text;
}

template <typename Values, typename Text>
std::string ListText(const Values& values, Text text) {
  std::string list;
  for (const auto& value : values) list += (list.empty() ? "" : ", ") + text(value);
  return "[" + list + "]";
}

std::string EvidenceText(const std::string& numbers, const std::string& source) {
  return ", evidence: {" + numbers + ", from: " + Quoted(source) + "}}";
}

std::string RelaxationText(const Relaxation& relaxation) {
  const auto share = [](const RelaxationTerm& term) { return NumbersText("%.6g", term.share); };
  const auto time = [](const RelaxationTerm& term) { return NumbersText("%.6g", term.time_s); };
  const auto sigma = [](double value) { return NumbersText("%.3g", value); };
  const std::string text =
      "{shares: " + ListText(relaxation.terms, share) + ", times_s: " + ListText(relaxation.terms, time);
  if (relaxation.share_sigmas.empty()) return text + "}";
  return text +
         EvidenceText("standard_deviations: " + ListText(relaxation.share_sigmas, sigma), relaxation.source);
}

// skin.material as one flow mapping.
std::string MaterialText(const LinkModel& model) {
  const Material& material = model.material;
  std::string text = "{youngs_modulus_mpa: " + NumbersText("%.6g", material.youngs_modulus_mpa) +
                     ", poisson_ratio: " + NumbersText("%.6g", material.poisson_ratio) +
                     ", law: " + Name(material.law);
  if (model.relaxation.any()) text += ", relaxation: " + RelaxationText(model.relaxation);
  if (!model.material_evidence) return text + "}";
  return text +
         EvidenceText("standard_deviation_mpa: " + NumbersText("%.3g", model.material_evidence->sigma_mpa),
                      model.material_evidence->source);
}

// Where a node begins; yaml-cpp counts lines and columns from 0.
size_t Begin(const std::string& text, const YAML::Node& node) {
  size_t at = 0;
  for (int line = 0; line < node.Mark().line; ++line) at = text.find('\n', at) + 1;
  return at + static_cast<size_t>(node.Mark().column);
}

// One past the closing brace of the flow mapping at `at`.
size_t EndOfFlow(const std::string& text, size_t at) {
  int depth = 0;
  char quote = 0;
  for (; at < text.size(); ++at) {
    const char c = text[at];
    if (quote != 0) {
      quote = c == quote ? char{0} : quote;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '{') {
      ++depth;
    } else if (c == '}' && --depth == 0) {
      return at + 1;
    }
  }
  return at;
}

// One past the last line of the block mapping whose first key is at `at`; empty lines and comments after it
// are not its own.
size_t EndOfBlock(const std::string& text, size_t at, size_t column) {
  size_t end = at;
  for (size_t line = at - column; line < text.size();) {
    const size_t next = std::min(text.find('\n', line), text.size());
    const size_t first = text.find_first_not_of(" \t\r", line);
    if (first != std::string::npos && first < next && text[first] != '#') {
      if (first - line < column) break;
      end = next;
    }
    line = next + 1;
  }
  return end;
}

// The text with the material section of the model as `change` leaves it.
Result<std::string> WithMaterialOf(const std::string& name, const std::string& content,
                                   const std::function<void(LinkModel&)>& change) {
  const auto before = ParseLinkModel(name, content);
  if (!before) return before.error();
  LinkModel changed = *before;
  change(changed);
  const YAML::Node root = YAML::Load(content);
  const YAML::Node version = root["taclink_model"], node = root["skin"]["material"];
  const size_t begin = Begin(content, node), version_begin = Begin(content, version);
  const bool flow = begin < content.size() && content[begin] == '{';
  const size_t end =
      flow ? EndOfFlow(content, begin) : EndOfBlock(content, begin, static_cast<size_t>(node.Mark().column));
  const size_t version_size = version.Scalar().size();
  std::string text = content;
  const auto put = [&text](size_t at, size_t size, const std::string& with) { text.replace(at, size, with); };
  // The later one first: it moves what follows.
  if (version_begin > begin) put(version_begin, version_size, kVersion);
  put(begin, end - begin, MaterialText(changed));
  if (version_begin < begin) put(version_begin, version_size, kVersion);
  const auto after = ParseLinkModel(name, text);
  if (!after || MaterialText(*after) != MaterialText(changed) ||
      after->markers.count() != before->markers.count()) {
    return Error{ErrorCode::kUnsupported,
                 name + ": its material is written in a way that can't be edited; put in by hand material: " +
                     MaterialText(changed) + " and taclink_model: " + kVersion};
  }
  return text;
}

}  // namespace

Result<std::string> LinkModelText(const std::string& name_or_path) {
  if (const auto text = ShippedModelText(name_or_path); !text.empty()) return std::string(text);
  return ReadFile(name_or_path);
}

Result<std::string> WithMaterial(const std::string& name, const std::string& content,
                                 const Material& material, const MaterialEvidence& evidence) {
  return WithMaterialOf(name, content, [&](LinkModel& model) {
    model.material = material;
    model.material_evidence = evidence;
  });
}

Result<std::string> WithRelaxation(const std::string& name, const std::string& content,
                                   const Relaxation& relaxation) {
  return WithMaterialOf(name, content, [&](LinkModel& model) { model.relaxation = relaxation; });
}

}  // namespace taclink
