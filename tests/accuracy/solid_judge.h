#pragma once

#include <string>
#include <vector>

#include "sensing/core/contact.h"
#include "tests/accuracy/solid_scenes.h"

namespace taclink {

/// Contacts that were found, against the true ones.
struct SolidVerdict {
  /// What is wrong; empty: nothing. Each body's force (of distributed loads, their sum) must be within a
  /// tenth or 0.03 N, its center within 4 mm, and nothing else above 0.03 N may be found.
  std::string fault;
  double force_error_n = 0;    ///< the largest of the bodies', and of contacts that do not exist
  double center_error_mm = 0;  ///< the largest of the bodies' above 0.03 N; distributed loads: 0
};
SolidVerdict JudgeContacts(const SolidScene& scene, const std::vector<Contact>& found);

}  // namespace taclink
