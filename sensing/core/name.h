#pragma once

#include <cstddef>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink {

inline constexpr size_t kLongestName = 64;
inline constexpr size_t kLongestNote = 4096;

/// The one syntax of names that users give: of arms, links, regions, recordings and sites. 1
/// to 64 ASCII letters, digits, '_', '-' and '.', the first neither '-' nor '.': a name is one word that no
/// shell and no terminal takes for something else, no option, no hidden file and no folder. Errors:
/// kInvalidArgument, to be put behind what the name is of.
Result<void> CheckName(std::string_view name);

/// CheckName for one part of a dotted subject of NATS: no '.' either.
Result<void> CheckSubjectPart(std::string_view name);

/// What users write in their own words: UTF-8 of up to 4096 bytes, no control characters (IsControl) but
/// newlines and tabs. Errors: as CheckName.
Result<void> CheckNote(std::string_view note);

}  // namespace taclink
