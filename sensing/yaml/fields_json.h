#pragma once

#include <nlohmann/json.hpp>

#include "sensing/yaml/fields.h"

namespace taclink {

/// The object of FieldsSchema, in the order of the keys.
nlohmann::ordered_json FieldsJson(const FieldVisitor::Fields& fields);

}  // namespace taclink
