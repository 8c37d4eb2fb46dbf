#include "server/arm/arm_kinematics.h"

#include <algorithm>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <set>
#include <utility>

#include "sensing/core/read_file.h"
#include "server/arm/urdf_tree.h"

namespace taclink::server {
namespace {

constexpr uintmax_t kMaxFileBytes = 16 << 20;

/// From the base to one frame.
struct FrameChain {
  std::string name;
  KDL::Chain chain;
  std::vector<JointRule> rules;  ///< by the chain's moving joints
  std::vector<size_t> joints;    ///< that move it; rising
};

FrameChain MakeChain(const UrdfTree& urdf, const std::string& base, const std::string& frame) {
  FrameChain out{.name = frame, .chain = {}, .rules = {}, .joints = {}};
  urdf.tree.getChain(base, frame, out.chain);
  std::set<size_t> joints;
  for (const KDL::Segment& segment : out.chain.segments) {
    if (segment.getJoint().getType() == KDL::Joint::Fixed) continue;
    out.rules.push_back(urdf.rules.at(segment.getJoint().getName()));
    joints.insert(out.rules.back().joint);
  }
  out.joints.assign(joints.begin(), joints.end());
  return out;
}

KDL::JntArray Positions(const FrameChain& frame, std::span<const double> positions) {
  KDL::JntArray out(static_cast<unsigned>(frame.rules.size()));
  for (unsigned i = 0; i < out.rows(); ++i) {
    const JointRule& rule = frame.rules[i];
    out(i) = rule.factor * positions[rule.joint] + rule.offset;
  }
  return out;
}

KDL::Frame EndOf(const FrameChain& frame, const KDL::JntArray& positions) {
  KDL::Frame end;
  KDL::ChainFkSolverPos_recursive(frame.chain).JntToCart(positions, end);
  return end;
}

}  // namespace

struct ArmKinematics::Parts {
  std::string file;
  std::string base;
  std::vector<JointInfo> joints;
  std::set<std::string> dependent;
  std::vector<FrameChain> frames;
  std::vector<ArmVisual> visuals;
  std::vector<size_t> drawn_frames;

  Result<size_t> Find(const std::string& frame) const;
};

Result<size_t> ArmKinematics::Parts::Find(const std::string& frame) const {
  std::string known;
  for (size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].name == frame) return i;
    known += (known.empty() ? "" : ", ") + frames[i].name;
  }
  return Error{ErrorCode::kNotFound, file + ": no link '" + frame + "'; there are: " + known};
}

ArmKinematics::ArmKinematics(std::unique_ptr<const Parts> parts) : parts_(std::move(parts)) {}
ArmKinematics::~ArmKinematics() = default;

Result<std::shared_ptr<const ArmKinematics>> ArmKinematics::Load(const std::string& path,
                                                                 const std::string& base) {
  const auto xml = ReadFile(path);
  if (!xml) return Error{xml.error().code, "URDF " + xml.error().message};
  return Parse(path, *xml, base);
}

Result<std::shared_ptr<const ArmKinematics>> ArmKinematics::Parse(const std::string& name,
                                                                  const std::string& xml,
                                                                  const std::string& base) {
  auto urdf = ReadUrdf(name, xml);
  if (!urdf) return urdf.error();
  auto parts = std::make_unique<Parts>();
  parts->file = name;
  parts->base = base.empty() ? urdf->root : base;
  for (const std::string& frame : urdf->frames) parts->frames.push_back({frame, {}, {}, {}});
  if (const auto found = parts->Find(parts->base); !found)
    return Error{found.error().code, found.error().message + "; correct arm.base"};
  for (FrameChain& frame : parts->frames) frame = MakeChain(*urdf, parts->base, frame.name);
  parts->joints = std::move(urdf->joints);
  parts->dependent = std::move(urdf->dependent);
  parts->visuals = std::move(urdf->visuals);
  std::set<size_t> drawn;
  for (const ArmVisual& visual : parts->visuals) drawn.insert(visual.frame);
  parts->drawn_frames.assign(drawn.begin(), drawn.end());
  return std::shared_ptr<const ArmKinematics>(new ArmKinematics(std::move(parts)));
}

const std::string& ArmKinematics::base() const {
  return parts_->base;
}
const std::vector<JointInfo>& ArmKinematics::joints() const {
  return parts_->joints;
}
const std::vector<ArmVisual>& ArmKinematics::visuals() const {
  return parts_->visuals;
}
const std::vector<size_t>& ArmKinematics::drawn_frames() const {
  return parts_->drawn_frames;
}
const std::string& ArmKinematics::frame_name(size_t frame) const {
  return parts_->frames[frame].name;
}
const std::vector<size_t>& ArmKinematics::JointsOf(size_t frame) const {
  return parts_->frames[frame].joints;
}
bool ArmKinematics::IsDependent(const std::string& joint) const {
  return parts_->dependent.contains(joint);
}

std::optional<size_t> ArmKinematics::FindJoint(const std::string& name) const {
  const auto& joints = parts_->joints;
  const auto at =
      std::find_if(joints.begin(), joints.end(), [&](const JointInfo& joint) { return joint.name == name; });
  if (at == joints.end()) return std::nullopt;
  return static_cast<size_t>(at - joints.begin());
}

Result<size_t> ArmKinematics::FindFrame(const std::string& name) const {
  return parts_->Find(name);
}

Rigid3 ArmKinematics::BaseFromFrame(size_t frame, std::span<const double> positions) const {
  const FrameChain& chain = parts_->frames[frame];
  const KDL::Frame end = EndOf(chain, Positions(chain, positions));
  Rigid3 out;
  for (int row = 0; row < 3; ++row) {
    out.translation[row] = end.p(row);
    for (int column = 0; column < 3; ++column) out.rotation(row, column) = end.M(row, column);
  }
  return out;
}

ArmKinematics::Jacobian6 ArmKinematics::Jacobian(size_t frame, const Vec3& p_in_base_mm,
                                                 std::span<const double> positions) const {
  const FrameChain& chain = parts_->frames[frame];
  const KDL::JntArray q = Positions(chain, positions);
  KDL::Jacobian of_chain(q.rows());
  KDL::ChainJntToJacSolver(chain.chain).JntToJac(q, of_chain);
  const KDL::Vector p(p_in_base_mm.x(), p_in_base_mm.y(), p_in_base_mm.z());
  of_chain.changeRefPoint(p - EndOf(chain, q).p);
  Jacobian6 out = Jacobian6::Zero(6, static_cast<Eigen::Index>(parts_->joints.size()));
  for (unsigned i = 0; i < q.rows(); ++i) {
    const JointRule& rule = chain.rules[i];
    out.col(static_cast<Eigen::Index>(rule.joint)) += rule.factor * of_chain.data.col(i);
  }
  return out;
}

}  // namespace taclink::server
