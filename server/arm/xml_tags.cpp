#include "server/arm/xml_tags.h"

#include <algorithm>

namespace taclink::server {
namespace {

constexpr std::string_view kBlanks = " \t\r\n\f\v";
constexpr std::string_view kComment = "<!--", kCdata = "<![CDATA[";

// Any byte beyond ASCII may begin a name.
bool BeginsName(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z') || byte == '_' || byte == ':' ||
         byte >= 0x80;
}

}  // namespace

bool XmlTag::Uses(std::string_view prefix) const {
  if (name.starts_with(prefix)) return true;
  char quote = '\0';
  for (size_t at = name.size(); at + 1 < inside.size(); ++at) {
    const char c = inside[at];
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (kBlanks.find(c) != std::string_view::npos && inside.substr(at + 1).starts_with(prefix)) {
      return true;
    }
  }
  return false;
}

void XmlTags::SkipPast(std::string_view end) {
  const size_t at = rest_.find(end);
  rest_.remove_prefix(at == std::string_view::npos ? rest_.size() : at + end.size());
}

std::optional<XmlTag> XmlTags::Next() {
  while (true) {
    rest_.remove_prefix(std::min(rest_.find('<'), rest_.size()));
    if (rest_.empty()) return std::nullopt;
    if (rest_.starts_with(kComment)) {
      rest_.remove_prefix(kComment.size());
      SkipPast("-->");
    } else if (rest_.starts_with(kCdata)) {
      rest_.remove_prefix(kCdata.size());
      SkipPast("]]>");
    } else {
      rest_.remove_prefix(1);
      if (auto tag = TagAtStart()) return tag;
      // Declarations and instructions: parsers differ in where these end, so that tags in them count.
    }
  }
}

std::optional<XmlTag> XmlTags::TagAtStart() {
  XmlTag tag;
  tag.is_end = rest_.starts_with('/');
  const std::string_view begin = rest_.substr(tag.is_end ? 1 : 0);
  if (begin.empty() || !BeginsName(begin.front())) return std::nullopt;
  char quote = '\0';
  size_t size = 0;
  for (; size < begin.size() && (quote != '\0' || begin[size] != '>'); ++size) {
    const char c = begin[size];
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    }
  }
  tag.inside = begin.substr(0, size);
  tag.is_empty = !tag.is_end && tag.inside.ends_with('/');
  if (tag.is_empty) tag.inside.remove_suffix(1);
  tag.name = tag.inside.substr(0, tag.inside.find_first_of(kBlanks));
  rest_ = begin.substr(std::min(size + 1, begin.size()));
  return tag;
}

}  // namespace taclink::server
