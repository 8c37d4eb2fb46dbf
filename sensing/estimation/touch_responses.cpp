#include "sensing/estimation/touch_responses.h"

#include "sensing/estimation/linearization.h"

namespace taclink {

std::optional<Eigen::MatrixXf> TouchResponses(SkinMechanics& mechanics, const KnownLoads& loads) {
  const UntouchedSkin* const untouched = mechanics.Untouched(loads);
  if (untouched == nullptr) return std::nullopt;
  Linearization skin(mechanics);
  const auto inflated = untouched->inflated();
  if (!(inflated ? skin.At(inflated, loads) : skin.At(untouched->state, loads))) return std::nullopt;
  LoadCases cases;
  for (int marker = 0; marker < mechanics.marker_count(); ++marker) {
    cases.Begin();
    const int at = mechanics.markers().node(marker) - mechanics.columns();
    for (Eigen::SparseMatrix<double>::InnerIterator share(mechanics.spread(), at); share; ++share) {
      const auto site = static_cast<int>(share.row());
      cases.Add(site, share.value() * skin.ForceAt(Linearization::kInward, site));
    }
  }
  return skin.Displacements(cases);
}

}  // namespace taclink
