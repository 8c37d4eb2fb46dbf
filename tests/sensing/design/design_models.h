#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "sensing/model/model_file.h"

namespace taclink {

/// A shipped model with lines of its file replaced; each piece of text must be there.
inline LinkModel Altered(const std::string& shipped,
                         const std::vector<std::pair<std::string, std::string>>& replacements) {
  std::string text(ShippedModelText(shipped));
  for (const auto& [from, to] : replacements) {
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    if (at != std::string::npos) text.replace(at, from.size(), to);
  }
  auto model = ParseLinkModel(shipped, text);
  EXPECT_TRUE(model.ok()) << (model.ok() ? "" : model.error().message);
  return model.ok() ? *std::move(model) : LoadLinkModel(shipped).value();
}

}  // namespace taclink
