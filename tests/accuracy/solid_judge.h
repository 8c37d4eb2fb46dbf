#pragma once

#include <string>
#include <vector>

#include "sensing/core/contact.h"
#include "tests/accuracy/solid_scenes.h"

namespace taclink {

/// What is wrong with contacts that were found of a scene; empty: nothing. Each body's force (of distributed
/// loads, their sum) within a tenth or 0.03 N, its center within 4 mm, nothing else above 0.03 N.
std::string FaultOf(const SolidScene& scene, const std::vector<Contact>& found);

}  // namespace taclink
