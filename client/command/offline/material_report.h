#pragma once

#include <string>
#include <vector>

#include "client/command/cli/json.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/identification/material_fit.h"

namespace taclink::command {

/// Fits of one or both laws to the same records.
struct MaterialChoice {
  struct Refusal {
    MaterialLaw law;
    Error why;
  };
  std::vector<MaterialFit> fits;  ///< not empty
  std::vector<Refusal> refusals;
  size_t chosen = 0;     ///< of fits
  bool decided = false;  ///< by the records; else it is the model's own law

  const MaterialFit& fit() const { return fits[chosen]; }
};

/// The law whose misfit is the smallest; of two within 10 %, which no record tells apart, the model's.
MaterialChoice ChooseLaw(std::vector<MaterialFit> fits, std::vector<MaterialChoice::Refusal> refusals,
                         MaterialLaw model_law);

/// What the model file says of the chosen fit.
MaterialEvidence EvidenceOf(const MaterialFit& fit);

void PrintMaterialText(const LinkModel& model, const MaterialChoice& choice);
void PrintMaterialJson(const LinkModel& model, const MaterialChoice& choice);

}  // namespace taclink::command
