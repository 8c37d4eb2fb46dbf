#include "sensing/simulation/live_skin.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/core/units.h"

namespace taclink {
namespace {

constexpr double kTouchMm = 0.02;     // of a body that begins to press
constexpr double kGoneN = 1e-6;       // a body that presses less has left
constexpr double kSphereShare = 0.3;  // of its diameter, where a sphere touches first
// Of the way to a key that has no equilibrium at once.
constexpr double kLeastStep = 1.0 / 16;
// Frames of the link wait for a key. Most keys need 1 to 4 factorizations of about 15 ms; one that needs more
// uses those of keys before and after it.
constexpr int kFactorizationsPerKey = 10, kMostSaved = 15;
constexpr double kStepGrowth = 1.5;  // less than twice: a try that fails costs more than one that holds
constexpr double kRateShare = 1e-3;  // of the way to a key, for rates
constexpr double kMostPredictedMm = 8;
constexpr double kSameMpa = 1e-7, kSameRad = 2e-3, kSameRadps = 2e-2;

template <typename T>
T Mixed(const T& a, const T& b, double share) {
  return a + share * (b - a);
}

// A key lies ahead of the time for which the pressure is given. A pressure that changes, such as that of a
// regulator, is continued to the key; otherwise the skin would follow it late.
Handling Ahead(Handling wanted, double by_s) {
  if (wanted.pressure_mpa)
    wanted.pressure_mpa = std::max(0.0, *wanted.pressure_mpa + by_s * wanted.pressure_mpaps);
  return wanted;
}

}  // namespace

LiveSkin::LiveSkin(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
                   std::vector<ShellState> free_skins)
    : model_(model),
      scene_(scene),
      scene_discs_(scene.contacts.size()),
      skin_(model, scene_discs_ + kMostBodyParts, {.refinement = scene.refinement}),
      loads_(model, scene, std::move(plans), skin_.mesh()),
      finder_(model, skin_.mesh()),
      balance_(skin_.Rest()),
      history_(model) {
  loads_.SetFreeSkins(std::move(free_skins));
}

bool LiveSkin::Begin(double time_s, const SkinNodes& nodes, std::span<const KeyContact> contacts) {
  trouble_.clear();
  step_ = 1;
  effort_ = 0;
  balance_ = skin_.NearTo(nodes.mids_mm, nodes.directors);
  for (size_t i = 0; i < contacts.size(); ++i) {
    if (contacts[i].on) balance_.depth_mm[i] = contacts[i].value[6];
    balance_.limited[i] = contacts[i].limited;
  }
  const HandledGoal goal = GoalAt(time_s, {});
  motion_ = {{}, goal.pressure_mpa, goal.joint};
  BeginHistory(time_s);
  if (!Balance(time_s, motion_, balance_)) return false;
  from_ = to_ = MakeKey(time_s);
  return true;
}

// The scene keeps no internal forces: those are taken that hold the skin where the scene has it.
void LiveSkin::BeginHistory(double time_s) {
  if (!history_.any()) return;
  const Eigen::VectorXd elastic_n = skin_.InternalForces(balance_.state);
  history_.Begin(time_s, elastic_n, elastic_n - skin_.Residual(LoadAt(time_s, motion_), balance_));
}

bool LiveSkin::Evaluate(double time_s, const Handling& wanted, SkinNodes& nodes, SkinTruth& truth) {
  while (to_.time_s < time_s) {
    // A late caller gets one longer span rather than many.
    const double next_s = std::max(to_.time_s + kKeySpanS, time_s);
    if (!NextKey(next_s, Ahead(wanted, next_s - time_s))) return false;
  }
  if (IsAlone(to_.time_s, wanted)) return false;
  Interpolate(time_s, nodes, truth);
  return true;
}

HandledGoal LiveSkin::GoalAt(double time_s, const Handling& wanted) const {
  const double t = SceneTime(time_s);
  HandledGoal goal{.pressure_mpa = wanted.pressure_mpa.value_or(kMpaPerKpa * scene_.PressureKpa(t)),
                   .joint = {}};
  if (wanted.joint_rad)
    goal.joint.rad = *wanted.joint_rad;
  else if (scene_.motion && scene_.motion->swing)
    goal.joint = scene_.motion->swing->At(t);
  return goal;
}

SkinLoad LiveSkin::LoadAt(double time_s, const HandledMotion& motion) const {
  const double t = SceneTime(time_s);
  SkinLoad load = loads_.At(loads_.PartAt(t), t);
  load.pressure_mpa = motion.pressure_mpa;
  if (scene_.motion)
    load.specific_force_mps2 = scene_.motion->SpecificForce(motion.joint, Vec3(0, 0, model_.length_mm / 2));
  load.discs.resize(scene_discs_ + kMostBodyParts);
  PlaceDiscs(model_, motion, std::span(load.discs).subspan(scene_discs_));
  return load;
}

void LiveSkin::PlaceNewDiscs(const SkinLoad& load, SkinBalance& balance) const {
  for (size_t i = 0; i < load.discs.size(); ++i) {
    const SkinDisc& disc = load.discs[i];
    if (!disc.on) {
      balance.depth_mm[i] = kOffMm;
      balance.limited[i] = false;
    } else if (!std::isfinite(balance.depth_mm[i])) {
      balance.depth_mm[i] =
          kTouchMm + loads_.TouchingDepth(disc.diameter_mm, {disc.angle_rad, disc.z_mm}, balance.state);
    }
  }
}

bool LiveSkin::Balance(double time_s, const HandledMotion& motion, SkinBalance guess) {
  const SkinLoad load = ElasticLoadAt(time_s, motion);
  PlaceNewDiscs(load, guess);
  is_balance_newest_ = skin_.Balance(load, guess).ok();
  if (is_balance_newest_) balance_ = std::move(guess);
  return is_balance_newest_;
}

// By how the equilibrium changes at the beginning of the way. Without a prediction a disc that moves by a
// millimeter leaves the skin in a state that no minimum of the energy is near to.
SkinBalance LiveSkin::Predicted(double from_s, const HandledMotion& from, double to_s,
                                const HandledMotion& to) {
  if (!is_balance_newest_ && !Balance(from_s, from, balance_)) return balance_;
  const auto load_at = [&](double share) {
    return ElasticLoadAt(from_s + share * (to_s - from_s), Between(from, to, share));
  };
  // Not from 0 on, where what begins to press with a force is not on yet.
  const SkinLoad before = load_at(kRateShare), after = load_at(2 * kRateShare);
  const std::vector<double> depths_mm = balance_.depth_mm;
  SkinBalance guess = balance_;
  PlaceNewDiscs(after, guess);
  const SkinRates rates = skin_.RatesAt(before, after, kRateShare, guess);
  std::vector<Vec3> directors = guess.state.directors;
  for (size_t i = 0; i < rates.mids_mm.size(); ++i) {
    if (!(rates.mids_mm[i].norm() < kMostPredictedMm)) return balance_;
    guess.state.mids_mm[i] += rates.mids_mm[i];
    directors[i] += rates.directors[i];
  }
  SkinBalance predicted = skin_.NearTo(guess.state.mids_mm, directors);
  predicted.limited = guess.limited;
  predicted.depth_mm = guess.depth_mm;
  for (size_t i = 0; i < depths_mm.size(); ++i)
    if (std::isfinite(depths_mm[i]) && std::isfinite(rates.depth_mm[i]))
      predicted.depth_mm[i] += rates.depth_mm[i];
  return predicted;
}

// Goes on as far as so many factorizations allow, in steps that begin with `step`. Returns the share of the
// way where balance_ is.
double LiveSkin::Reach(double from_s, const HandledMotion& from, double to_s, const HandledMotion& to,
                       int most_factorizations, double& step) {
  const int before = skin_.factorizations();
  const auto time_at = [&](double share) { return from_s + share * (to_s - from_s); };
  double reached = 0;
  while (reached < 1 && skin_.factorizations() - before < most_factorizations) {
    const double next = std::min(reached + step, 1.0);
    const HandledMotion here = Between(from, to, reached), there = Between(from, to, next);
    if (Balance(time_at(next), there, Predicted(time_at(reached), here, time_at(next), there))) {
      reached = next;
      step = std::min(kStepGrowth * step, 1.0);
    } else if (step > kLeastStep) {
      step /= 2;
    } else {
      break;
    }
  }
  return reached;
}

// Bodies that can't go on at their speed go on slower or stay where they are, while the pressure goes on
// without them: that of a regulator does not wait for a body. Where that has no equilibrium either, the user
// lets go of all.
bool LiveSkin::NextKey(double time_s, const Handling& wanted) {
  from_ = std::move(to_);
  RemoveBodies();
  AddBodies(wanted.bodies);
  const HandledMotion before = motion_;
  const double span_s = time_s - from_.time_s;
  motion_ = MovedOn(model_, before, wanted.bodies, GoalAt(time_s, wanted), span_s);
  effort_ = std::min(effort_ + kFactorizationsPerKey, kMostSaved);
  const bool tries = effort_ > 0;
  const int spent_before = skin_.factorizations();
  const double reached = Reach(from_.time_s, before, time_s, motion_, effort_, step_);
  if (tries) trouble_.clear();
  if (reached < 1) {
    const HandledMotion here = Between(before, motion_, reached);
    HandledMotion inflated = here;
    inflated.pressure_mpa = motion_.pressure_mpa;
    double step = 1, share = 0;
    if (here.pressure_mpa != inflated.pressure_mpa)
      share = Reach(from_.time_s + reached * span_s, here, time_s, inflated, kFactorizationsPerKey, step);
    motion_ = Between(here, inflated, share);
  }
  effort_ -= skin_.factorizations() - spent_before;
  if (reached < 1) {
    if (tries && reached == 0 && step_ <= kLeastStep)
      trouble_ = "what presses stays where it is: the skin has no equilibrium further on, it would snap";
    if (!Balance(time_s, motion_, balance_)) {
      trouble_ = "what pressed was taken off: the skin has no equilibrium under it";
      return false;
    }
  }
  if (history_.any()) history_.Advance(time_s, skin_.InternalForces(balance_.state));
  to_ = MakeKey(time_s);
  ReadBack(to_.contacts);
  return true;
}

void LiveSkin::AddBodies(const std::vector<PressedBody>& wanted) {
  size_t parts = 0;
  for (const MovingBody& body : motion_.bodies) parts += body.touching_mm.size();
  for (const PressedBody& body : wanted) {
    if (std::ranges::any_of(motion_.bodies, [&](const MovingBody& one) { return one.wanted.id == body.id; }))
      continue;
    const std::vector<BodyPart> of_body = PartsOf(model_, body);
    if (parts + of_body.size() > kMostBodyParts) continue;  // until others have left
    parts += of_body.size();
    MovingBody& added =
        motion_.bodies.emplace_back(MovingBody{.wanted = body, .at = body.at, .touching_mm = {}});
    for (const BodyPart& part : of_body) {
      const double across_mm = part.is_sphere ? kSphereShare * part.diameter_mm : part.diameter_mm;
      added.touching_mm.push_back(loads_.TouchingDepth(
          across_mm, {body.at.angle_rad + part.angle_rad, body.at.z_mm}, balance_.state));
    }
  }
}

// Those that have left. Discs of the bodies behind them move up, and their depths with them.
void LiveSkin::RemoveBodies() {
  size_t slot = scene_discs_;
  for (size_t i = 0; i < motion_.bodies.size();) {
    const MovingBody& body = motion_.bodies[i];
    const size_t parts = body.touching_mm.size();
    double pressing_n = 0;
    for (const TrueContact& contact : from_.contacts)
      if (contact.body_id == body.wanted.id) pressing_n += contact.force_n.norm();
    if (!body.leaves || pressing_n > kGoneN) {
      slot += parts;
      ++i;
      continue;
    }
    const auto from = static_cast<std::ptrdiff_t>(slot), to = static_cast<std::ptrdiff_t>(slot + parts);
    balance_.depth_mm.erase(balance_.depth_mm.begin() + from, balance_.depth_mm.begin() + to);
    balance_.limited.erase(balance_.limited.begin() + from, balance_.limited.begin() + to);
    balance_.depth_mm.resize(scene_discs_ + kMostBodyParts, kOffMm);
    balance_.limited.resize(scene_discs_ + kMostBodyParts, false);
    motion_.bodies.erase(motion_.bodies.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

// A body that is moved by its depth goes on from the force that it has, and the other way round.
void LiveSkin::ReadBack(const std::vector<TrueContact>& contacts) {
  for (MovingBody& body : motion_.bodies) {
    double force_n = 0, depth_mm = 0;
    int found = 0;
    for (const TrueContact& contact : contacts) {
      if (contact.body_id != body.wanted.id) continue;
      force_n += contact.force_n.norm();
      depth_mm += contact.depth_mm - body.touching_mm[static_cast<size_t>(found++)];
    }
    if (body.wanted.force_n)
      body.depth_mm = found > 0 ? depth_mm / found : 0;
    else
      body.force_n = force_n;
  }
}

bool LiveSkin::IsAlone(double time_s, const Handling& wanted) const {
  if (history_.any()) return false;
  const HandledGoal goal = GoalAt(time_s, wanted);
  return !wanted.any() && motion_.bodies.empty() &&
         std::abs(goal.pressure_mpa - motion_.pressure_mpa) < kSameMpa &&
         std::abs(goal.joint.rad - motion_.joint.rad) < kSameRad &&
         std::abs(goal.joint.radps - motion_.joint.radps) < kSameRadps;
}

LiveSkin::Key LiveSkin::MakeKey(double time_s) {
  const SkinLoad load = LoadAt(time_s, motion_);
  Key key{.time_s = time_s,
          .nodes = {balance_.state.mids_mm, balance_.state.directors},
          .contacts = {},
          .pressure_mpa = motion_.pressure_mpa,
          .specific_force_mps2 = load.specific_force_mps2,
          .joint = motion_.joint};
  const std::vector<RigidContact::Summary> summaries = skin_.Contacts(load, balance_);
  std::vector<std::pair<uint64_t, size_t>> names;  // body and index
  names.reserve(scene_discs_ + kMostBodyParts);
  for (size_t i = 0; i < scene_discs_; ++i) names.emplace_back(0, i);
  for (const MovingBody& body : motion_.bodies)
    for (size_t part = 0; part < body.touching_mm.size(); ++part)
      names.emplace_back(body.wanted.id, scene_discs_ + part);
  for (size_t i = 0; i < names.size(); ++i) {
    const SkinDisc& disc = load.discs[i];
    if (!disc.on) continue;
    TrueContact& contact = key.contacts.emplace_back();
    contact.body_id = names[i].first;
    contact.index = static_cast<int>(names[i].second);
    contact.force_n = summaries[i].force_n;
    contact.depth_mm = disc.force_n && !balance_.limited[i] ? balance_.depth_mm[i] : disc.depth_mm;
    contact.center_mm = summaries[i].points > 0
                            ? summaries[i].center_mm
                            : model_.PointAtDepth(disc.angle_rad, disc.z_mm, contact.depth_mm);
    contact.patch_diameter_mm = disc.diameter_mm;
    contact.limited = balance_.limited[i];
    finder_.AtPoint(disc.angle_rad, disc.z_mm, weights_);
    for (const NodeWeight& w : weights_)
      contact.normal += w.weight * key.nodes.directors[static_cast<size_t>(w.node)];
    contact.normal.normalize();
  }
  return key;
}

void LiveSkin::Interpolate(double time_s, SkinNodes& nodes, SkinTruth& truth) const {
  const double span_s = to_.time_s - from_.time_s;
  const double share = span_s > 0 ? (time_s - from_.time_s) / span_s : 1;
  const Key& a = span_s > 0 ? from_ : to_;
  nodes.mids_mm.resize(to_.nodes.mids_mm.size());
  nodes.directors.resize(to_.nodes.directors.size());
  for (size_t i = 0; i < nodes.mids_mm.size(); ++i) {
    nodes.mids_mm[i] = Mixed(a.nodes.mids_mm[i], to_.nodes.mids_mm[i], share);
    nodes.directors[i] = Mixed(a.nodes.directors[i], to_.nodes.directors[i], share);
  }
  truth.pressure_mpa = Mixed(a.pressure_mpa, to_.pressure_mpa, share);
  truth.specific_force_mps2 = Mixed(a.specific_force_mps2, to_.specific_force_mps2, share);
  truth.joint = {Mixed(a.joint.rad, to_.joint.rad, share), Mixed(a.joint.radps, to_.joint.radps, share),
                 Mixed(a.joint.radps2, to_.joint.radps2, share)};
  truth.contacts = to_.contacts;
  truth.total_force_n.setZero();
  for (TrueContact& contact : truth.contacts) {
    const auto before = std::ranges::find_if(a.contacts, [&](const TrueContact& one) {
      return one.index == contact.index && one.body_id == contact.body_id;
    });
    if (before == a.contacts.end()) {
      contact.force_n *= share;
    } else {
      contact.force_n = Mixed(before->force_n, contact.force_n, share);
      contact.center_mm = Mixed(before->center_mm, contact.center_mm, share);
      contact.depth_mm = Mixed(before->depth_mm, contact.depth_mm, share);
    }
    truth.total_force_n += contact.force_n;
  }
  std::erase_if(truth.contacts, [](const TrueContact& contact) { return contact.force_n.norm() < kGoneN; });
}

}  // namespace taclink
