#include "sensing/simulation/handled_motion.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/units.h"

namespace taclink {
namespace {

constexpr double kSlideMmps = 60, kPressMmps = 30;
constexpr double kPressS = 0.4;             // in which a force is reached,
constexpr double kLeastForceRateNps = 0.3;  // or faster
constexpr double kPressureRateKpaps = 1;
constexpr double kJointRadps = 1.2;
constexpr double kJointFrequencyRadps = 3;  // of the joint's critically damped motion
constexpr double kJointStepS = 0.01;

double Toward(double from, double to, double most) {
  return from + std::clamp(to - from, -most, most);
}

void MoveBody(MovingBody& body, double span_s) {
  const PressedBody& wanted = body.wanted;
  const double depth_mm = body.leaves ? -kPressMmps * span_s : wanted.depth_mm.value_or(0);
  const double force_n = body.leaves ? 0 : wanted.force_n.value_or(0);
  body.depth_mm = Toward(body.depth_mm, depth_mm, kPressMmps * span_s);
  const double rate = std::max(kLeastForceRateNps, wanted.force_n.value_or(0) / kPressS);
  body.force_n = Toward(body.force_n, force_n, rate * span_s);
}

void SlideBody(const LinkModel& model, MovingBody& body, double span_s) {
  const SkinSpot& to = body.wanted.at;
  const double radius = model.PointAtDepth(body.at.angle_rad, body.at.z_mm, 0).head<2>().norm();
  const double turn = std::remainder(to.angle_rad - body.at.angle_rad, 2 * kPi);
  const double way = std::hypot(radius * turn, to.z_mm - body.at.z_mm);
  const double share = way > kSlideMmps * span_s ? kSlideMmps * span_s / way : 1;
  body.at.angle_rad += share * turn;
  body.at.z_mm += share * (to.z_mm - body.at.z_mm);
}

// Semi-implicit Euler steps of a critically damped motion about the goal's own, whose speed is limited.
JointMotion MoveJoint(JointMotion joint, const JointMotion& goal, double span_s) {
  constexpr double w = kJointFrequencyRadps;
  const int steps = std::max(1, static_cast<int>(std::ceil(span_s / kJointStepS)));
  const double h = span_s / steps;
  for (int i = 0; i < steps; ++i) {
    const double left_s = span_s - i * h;
    const double goal_radps = goal.radps - left_s * goal.radps2;
    const double goal_rad = goal.rad - left_s * goal.radps + left_s * left_s / 2 * goal.radps2;
    const double before = joint.radps;
    const double wanted =
        before + h * (goal.radps2 + w * w * (goal_rad - joint.rad) + 2 * w * (goal_radps - before));
    joint.radps = std::clamp(wanted, -kJointRadps, kJointRadps);
    joint.radps2 = (joint.radps - before) / h;
    joint.rad += h * (joint.radps + before) / 2;
  }
  return joint;
}

}  // namespace

HandledMotion MovedOn(const LinkModel& model, HandledMotion motion, const std::vector<PressedBody>& wanted,
                      const HandledGoal& goal, double span_s) {
  for (MovingBody& body : motion.bodies) {
    const auto found = std::ranges::find_if(wanted, [&](const PressedBody& one) {
      return one.id == body.wanted.id && one.shape == body.wanted.shape &&
             one.diameter_mm == body.wanted.diameter_mm;
    });
    body.leaves = found == wanted.end();
    if (!body.leaves) body.wanted = *found;
    MoveBody(body, span_s);
    SlideBody(model, body, span_s);
  }
  motion.pressure_mpa =
      Toward(motion.pressure_mpa, goal.pressure_mpa, kMpaPerKpa * kPressureRateKpaps * span_s);
  motion.joint = MoveJoint(motion.joint, goal.joint, span_s);
  return motion;
}

HandledMotion Between(const HandledMotion& a, const HandledMotion& b, double share) {
  HandledMotion middle = b;
  const auto mean = [share](double x, double y) { return x + share * (y - x); };
  for (size_t i = 0; i < middle.bodies.size(); ++i) {
    MovingBody& body = middle.bodies[i];
    const MovingBody& before = a.bodies[i];
    body.at.angle_rad = mean(before.at.angle_rad, body.at.angle_rad);
    body.at.z_mm = mean(before.at.z_mm, body.at.z_mm);
    body.depth_mm = mean(before.depth_mm, body.depth_mm);
    body.force_n = mean(before.force_n, body.force_n);
  }
  middle.pressure_mpa = mean(a.pressure_mpa, b.pressure_mpa);
  middle.joint = {mean(a.joint.rad, b.joint.rad), mean(a.joint.radps, b.joint.radps),
                  mean(a.joint.radps2, b.joint.radps2)};
  return middle;
}

void PlaceDiscs(const LinkModel& model, const HandledMotion& motion, std::span<SkinDisc> discs) {
  size_t next = 0;
  for (const MovingBody& body : motion.bodies) {
    const std::vector<BodyPart> parts = PartsOf(model, body.wanted);
    for (size_t i = 0; i < parts.size(); ++i) {
      SkinDisc& disc = discs[next++];
      disc.on = !body.wanted.force_n || body.force_n > 0;
      disc.angle_rad = body.at.angle_rad + parts[i].angle_rad;
      disc.z_mm = body.at.z_mm;
      disc.diameter_mm = parts[i].diameter_mm;
      disc.is_sphere = parts[i].is_sphere;
      disc.depth_mm = MostDepth(model, {disc.angle_rad, disc.z_mm});
      if (body.wanted.force_n)
        disc.force_n = parts[i].force_share * body.force_n;
      else
        disc.depth_mm = std::min(disc.depth_mm, body.touching_mm[i] + body.depth_mm);
    }
  }
  for (; next < discs.size(); ++next) discs[next] = {};
}

}  // namespace taclink
