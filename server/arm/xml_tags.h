#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

// Internal to this folder.

namespace taclink::server {

/// A tag of an element.
struct XmlTag {
  std::string_view name;
  std::string_view inside;  ///< between < and >: the name and what follows it
  bool is_end = false;      ///< </name>
  bool is_empty = false;    ///< <name/>

  /// Whether its name, or that of an attribute, begins with `prefix`, such as "xacro:".
  bool Uses(std::string_view prefix) const;
};

/// The tags of an XML text one after the other, without recursion and without memory: for what has to be
/// known before a parser that recurses reads it. What stands in comments and CDATA is no tag. Of a text that
/// is not well-formed it sees at least the tags that a parser sees before it gives up. The text outlives it.
class XmlTags {
 public:
  explicit XmlTags(std::string_view text) : rest_(text) {}
  /// None: there are no more.
  std::optional<XmlTag> Next();

 private:
  std::optional<XmlTag> TagAtStart();
  void SkipPast(std::string_view end);

  std::string_view rest_;
};

}  // namespace taclink::server
