#pragma once

#include <span>
#include <string_view>

namespace taclink {

/// A file that the build puts into the program.
struct EmbeddedFile {
  std::string_view name;
  std::string_view content;
};

}  // namespace taclink
