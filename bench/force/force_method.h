#pragma once

#include <optional>
#include <string>

#include "sensing/core/contact.h"

namespace taclink {

/// A force model on a mesh. No model: the estimator chooses, frame by frame.
struct ForceMethod {
  std::optional<ForceModel> model;
  int refinement = 0;  ///< elements per interval of the marker grid; 0: the mesh that links have

  std::string mesh() const { return refinement == 0 ? "default" : std::to_string(refinement); }
  std::string name() const { return model ? Name(*model) : "auto"; }
};

}  // namespace taclink
