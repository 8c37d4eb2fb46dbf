#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace taclink::server {

/// What a caller may do; each role may do all of the one before.
enum class Role : uint8_t {
  kNobody,    ///< has shown nothing
  kViewer,    ///< sees everything, changes nothing
  kOperator,  ///< also calibrates, tares, configures
};

struct AccessRule {
  std::string_view path;  ///< a gRPC method, "/package.Service/Method", or a page of the HTTP gateway
  Role role;              ///< the least that may call it
};

/// Who may call what, over gRPC and over HTTP. The files of the web page are not in it: they hold no data and
/// anybody may fetch them.
std::span<const AccessRule> AccessTable();

/// What is not in the table is for operators.
Role NeededRole(std::string_view path);

}  // namespace taclink::server
