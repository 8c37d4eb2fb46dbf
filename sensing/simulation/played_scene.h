#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/simulation/scene_loads.h"

namespace taclink {

/// What a disc does to the skin at a key, and how that changes per second.
struct KeyContact {
  using Numbers = Eigen::Matrix<float, 7, 1>;  // force (N), center of pressure (mm), depth of the face (mm)
  Numbers value = Numbers::Zero(), rate = Numbers::Zero();
  bool on = false;
  bool limited = false;
};

/// A solved equilibrium of a scene. Rates are those of the equilibria along the scene.
struct SkinKey {
  double time_s = 0;
  /// By node: displacement of the mid-surface (mm), change of the director; and per second.
  Eigen::VectorXf place, rate;
  std::vector<KeyContact> contacts;  ///< by contact of the scene
};

/// The keys of a part by time: one if the part is still, else from its beginning to its end.
struct PlayedPart {
  ScenePart part;
  std::vector<SkinKey> keys;
};

/// Between two keys by the cubic that has their values and rates (Hermite's).
struct CubicWeights {
  float from, from_rate, to, to_rate;
};
CubicWeights CubicAt(const SkinKey& from, const SkinKey& to, double time_s);

inline Eigen::VectorXf PlaceAt(const SkinKey& from, const SkinKey& to, double time_s) {
  const CubicWeights w = CubicAt(from, to, time_s);
  return w.from * from.place + w.from_rate * from.rate + w.to * to.place + w.to_rate * to.rate;
}

inline KeyContact::Numbers ContactAt(const SkinKey& from, const SkinKey& to, size_t contact, double time_s) {
  const CubicWeights w = CubicAt(from, to, time_s);
  const KeyContact &a = from.contacts[contact], &b = to.contacts[contact];
  return w.from * a.value + w.from_rate * a.rate + w.to * b.value + w.to_rate * b.rate;
}

}  // namespace taclink
