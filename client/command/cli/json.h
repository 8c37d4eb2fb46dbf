#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink::command {

/// Keeps keys in the order they were written.
using Json = nlohmann::ordered_json;

inline Json ToJson(const Vec3& v) {
  return Json::array({v.x(), v.y(), v.z()});
}

inline Json ToJson(const std::array<double, 3>& v, double scale) {
  return Json::array({scale * v[0], scale * v[1], scale * v[2]});
}

inline Json ToJson(const std::vector<Vec3>& points) {
  Json list = Json::array();
  for (const Vec3& p : points) list.push_back(ToJson(p));
  return list;
}

inline Json ToJson(const std::vector<std::array<double, 3>>& points, double scale) {
  Json list = Json::array();
  for (const auto& p : points) list.push_back(ToJson(p, scale));
  return list;
}

}  // namespace taclink::command
