#pragma once

#include <vector>

#include "bench/force/accuracy_truth.h"
#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Farther than this from everything that a body touches, a contact is a phantom, mm.
inline constexpr double kPhantomMm = 25;
/// A body with less than this, N, need not be found.
inline constexpr double kLeastForceN = 0.01;

/// One real contact, and what was found within kPhantomMm of it and nearer to no other.
struct ContactScore {
  double true_n = 0;
  double size_error_n = 0;    ///< length of the force found less the true one's, absolute
  double vector_error_n = 0;  ///< length of the difference
  double direction_deg = 0;   ///< between the two; 180 if missed
  double center_mm = 0;       ///< distance of the centres (found ones weighted by force); if missed: none
  bool missed = false;
  /// Errors over what the covariances say, root of the traces; 0: not told.
  double force_deviations = 0, center_deviations = 0;

  bool SizeWithin() const;    ///< 10 % or 0.03 N, whichever is larger; a missed one has its whole force wrong
  bool VectorWithin() const;  ///< the same for the vector error
  bool CenterWithin() const { return !missed && center_mm <= 4; }
};

struct FrameScore {
  std::vector<ContactScore> contacts;
  double phantom_n = 0;  ///< contacts farther than kPhantomMm from any real one, sum of their forces
  double stray_n = 0;    ///< forces on markers as far away, sum of their lengths
  /// Size of each force, every centre, and no phantom above 0.03 N.
  bool Within() const;
  bool VectorWithin() const;  ///< the same with the vector errors
};

FrameScore ScoreContacts(const LinkModel& model, const TrueStage& truth, const NodalForces& forces,
                         const std::vector<Contact>& found);

}  // namespace taclink
