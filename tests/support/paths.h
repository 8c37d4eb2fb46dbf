#pragma once

#include <string>

/// Absolute paths of this checkout and build. They live in one generated source (paths.cpp.in), so that all
/// other objects are the same in every checkout and come from the compiler cache.
namespace taclink::testing {

extern const char* const kTaclinkd;  ///< the server
extern const char* const kTaclink;   ///< the command

/// The file or folder `name` below tests/data, tests/accuracy/calculix, deploy/config and
/// tests/fuzz/corpus/mcap.
std::string TestData(const std::string& name);
std::string CalculixData(const std::string& name);
std::string ShippedConfig(const std::string& name);
std::string FuzzLog(const std::string& name);

}  // namespace taclink::testing
