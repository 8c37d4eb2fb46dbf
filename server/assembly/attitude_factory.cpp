#include "server/assembly/attitude_factory.h"

#include <utility>

#include "server/arm/joint_attitude.h"
#include "server/arm/simulated_joints.h"
#include "server/attitude/client_attitude.h"

namespace taclink::server {
namespace {

struct AttitudeMaker {
  const Config& config;
  size_t link;
  const ArmPoses* poses;
  double length_mm;
  double sigma_mps2;

  using Made = std::unique_ptr<AttitudeSource>;
  Made operator()(const FixedGravityConfig&) const { return MakeFixedAttitude(); }
  Made operator()(const ConstantGravityConfig& constant) const {
    return MakeConstantAttitude(Vec3(constant.mps2.data()), sigma_mps2);
  }
  Made operator()(const JointGravityConfig&) const {
    if (poses == nullptr) return MakeFixedAttitude();
    return MakeJointAttitude(*poses, link,
                             {.gravity_mps2 = Vec3(config.kinematics.gravity_mps2.data()),
                              .sigma_mps2 = sigma_mps2,
                              .center_mm = Vec3(0, 0, length_mm / 2),
                              .length_mm = length_mm});
  }
  Made operator()(const ClientGravityConfig& client) const {
    return std::make_unique<ClientAttitude>(sigma_mps2, client.stale_after);
  }
  Made operator()(const UnknownGravityConfig&) const { return MakeUnknownAttitude(); }
};

bool IsSimulated(const LinkConfig& link) {
  return std::holds_alternative<SimulatedSourceConfig>(link.source);
}

bool IsMovedByJoints(const ArmPoses* poses, size_t link) {
  if (poses == nullptr || poses->kinematics() == nullptr || !poses->mounts()[link].frame) return false;
  return !poses->kinematics()->JointsOf(*poses->mounts()[link].frame).empty();
}

std::unique_ptr<AttitudeSource> ConfiguredAttitude(const Config& config, size_t link, const ArmPoses* poses,
                                                   double length_mm) {
  const LinkConfig& of_link = config.links[link];
  AttitudeMaker maker{config, link, poses, length_mm, kAttitudeSigmaMps2};
  if (of_link.gravity) {
    maker.sigma_mps2 = of_link.gravity->sigma_mps2;
    return std::visit(maker, of_link.gravity->source);
  }
  if (IsSimulated(of_link)) return MakeSourceAttitude();
  return IsMovedByJoints(poses, link) ? maker(JointGravityConfig{}) : MakeFixedAttitude();
}

}  // namespace

std::unique_ptr<AttitudeSource> MakeAttitude(const Config& config, size_t link, ArmPoses* poses,
                                             double length_mm) {
  auto attitude = ConfiguredAttitude(config, link, poses, length_mm);
  if (poses == nullptr || !IsSimulated(config.links[link])) return attitude;
  return PassSimulatedJoints(*poses, std::move(attitude));
}

}  // namespace taclink::server
