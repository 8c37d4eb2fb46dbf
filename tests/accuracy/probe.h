#pragma once

#include <gtest/gtest.h>

#include "sensing/shell/skin_push.h"

namespace taclink {

/// The prototype's probe on path 7, at a ring counted from 1.
inline SkinPushResult Pushed(const LinkModel& model, int ring, double depth_mm, double pressure_kpa) {
  const auto result = PushSkin(
      model,
      {.marker = model.MarkerIndex(6, ring - 1), .depth_mm = depth_mm, .pressure_mpa = pressure_kpa * 1e-3});
  EXPECT_TRUE(result.ok());
  return result.ok() ? *result : SkinPushResult{};
}

}  // namespace taclink
