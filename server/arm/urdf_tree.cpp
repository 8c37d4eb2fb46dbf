#include "server/arm/urdf_tree.h"

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <string_view>

#include "sensing/core/read_file.h"
#include "server/arm/xml_tags.h"

namespace taclink::server {
namespace {

constexpr double kMmPerMetre = 1e3;
constexpr size_t kMaxVisuals = 1000;
constexpr size_t kMaxLinks = 1000;        // every frame keeps its own chain of joints
constexpr size_t kMaxElements = 100'000;  // of which the parser makes objects, a hundred times their text
constexpr size_t kMaxDepth = 100;         // of elements

/// Keeps urdfdom's complaints, which it has only for the console.
class Complaints final : public console_bridge::OutputHandler {
 public:
  Complaints() { console_bridge::useOutputHandler(this); }
  ~Complaints() override { console_bridge::restorePreviousOutputHandler(); }
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first_.empty()) first_ = text;
  }
  std::string First() const { return first_.empty() ? "no <robot> with links and joints" : first_; }

 private:
  std::string first_;
};

// The handler is one for the whole process.
std::mutex& ParserMutex() {
  static std::mutex mutex;
  return mutex;
}

KDL::Vector ToKdl(const urdf::Vector3& v, double scale) {
  return {v.x * scale, v.y * scale, v.z * scale};
}

KDL::Frame ToKdl(const urdf::Pose& pose) {
  const urdf::Rotation& q = pose.rotation;
  return {KDL::Rotation::Quaternion(q.x, q.y, q.z, q.w), ToKdl(pose.position, kMmPerMetre)};
}

bool IsFinite(const KDL::Frame& frame) {
  double sum = 0;
  for (int row = 0; row < 3; ++row) {
    sum += frame.p(row);
    for (int column = 0; column < 3; ++column) sum += frame.M(row, column);
  }
  return std::isfinite(sum);
}

class Reader {
 public:
  explicit Reader(const urdf::ModelInterface& model) : model_(model) {}

  // Empty: all went well.
  std::string Read(UrdfTree& out) {
    out.root = model_.getRoot()->name;
    out.tree = KDL::Tree(out.root);
    ReadLink(*model_.getRoot(), out);
    if (trouble_.empty() && out.frames.size() != model_.links_.size())
      trouble_ = "some links hang on no joint that leads to the root link '" + out.root + "'";
    if (trouble_.empty()) ResolveMimics(out);
    return trouble_;
  }

 private:
  void ReadLink(const urdf::Link& link, UrdfTree& out) {
    for (const auto& visual : link.visual_array) ReadVisual(*visual, out);
    out.frames.push_back(link.name);
    for (const auto& joint : link.child_joints) {
      if (!trouble_.empty()) return;
      const KDL::Joint moving = ReadJoint(*joint, out);
      if (!trouble_.empty()) return;
      const KDL::Frame origin = ToKdl(joint->parent_to_joint_origin_transform);
      if (!IsFinite(origin)) return Fail(*joint, "has an <origin> that is not a number");
      out.tree.addSegment(KDL::Segment(joint->child_link_name, moving, origin), link.name);
      ReadLink(*model_.getLink(joint->child_link_name), out);
    }
  }

  static void ReadVisual(const urdf::Visual& visual, UrdfTree& out) {
    if (!visual.geometry || out.visuals.size() >= kMaxVisuals) return;
    const KDL::Frame origin = ToKdl(visual.origin);
    ArmVisual body{.frame = out.frames.size(), .color = {}};
    switch (visual.geometry->type) {
      case urdf::Geometry::BOX: {
        const urdf::Vector3& edges = static_cast<const urdf::Box&>(*visual.geometry).dim;
        body.size_mm = kMmPerMetre * Vec3(edges.x, edges.y, edges.z);
        break;
      }
      case urdf::Geometry::CYLINDER: {
        const auto& cylinder = static_cast<const urdf::Cylinder&>(*visual.geometry);
        body.shape = VisualShape::kCylinder;
        body.size_mm = kMmPerMetre * Vec3(2 * cylinder.radius, 2 * cylinder.radius, cylinder.length);
        break;
      }
      case urdf::Geometry::SPHERE:
        body.shape = VisualShape::kSphere;
        body.size_mm.setConstant(2 * kMmPerMetre * static_cast<const urdf::Sphere&>(*visual.geometry).radius);
        break;
      case urdf::Geometry::MESH:
        return;
    }
    // Only for looks: what can't be drawn is left out.
    if (!IsFinite(origin) || !body.size_mm.allFinite() || !(body.size_mm.minCoeff() > 0)) return;
    for (int row = 0; row < 3; ++row) {
      body.frame_from_visual.translation[row] = origin.p(row);
      for (int column = 0; column < 3; ++column)
        body.frame_from_visual.rotation(row, column) = origin.M(row, column);
    }
    if (visual.material)
      body.color = Vec3(visual.material->color.r, visual.material->color.g, visual.material->color.b);
    out.visuals.push_back(body);
  }

  KDL::Joint ReadJoint(const urdf::Joint& joint, UrdfTree& out) {
    if (joint.type == urdf::Joint::FIXED) {
      out.dependent.insert(joint.name);
      return KDL::Joint(joint.name, KDL::Joint::Fixed);
    }
    const bool slides = joint.type == urdf::Joint::PRISMATIC;
    if (!slides && joint.type != urdf::Joint::REVOLUTE && joint.type != urdf::Joint::CONTINUOUS) {
      Fail(joint, "is neither revolute, continuous, prismatic nor fixed; other types are not supported");
      return KDL::Joint();
    }
    const double length = ToKdl(joint.axis, 1).Norm();
    if (!std::isfinite(length) || length < 1e-9) {
      Fail(joint, "has no direction; give its <axis>");
      return KDL::Joint();
    }
    const double unit = slides ? kMmPerMetre : 1;
    if (joint.mimic) {
      out.dependent.insert(joint.name);
      mimics_.push_back(&joint);
    } else {
      out.rules[joint.name] = {.joint = out.joints.size(), .factor = unit, .offset = 0};
      out.joints.push_back(Info(joint));
    }
    const KDL::Frame origin = ToKdl(joint.parent_to_joint_origin_transform);
    return {joint.name, origin.p, origin.M * ToKdl(joint.axis, 1),
            slides ? KDL::Joint::TransAxis : KDL::Joint::RotAxis};
  }

  static JointInfo Info(const urdf::Joint& joint) {
    JointInfo info{.name = joint.name, .kind = JointKind::kRevolute, .limits = {}};
    if (joint.type == urdf::Joint::PRISMATIC) info.kind = JointKind::kPrismatic;
    if (joint.type == urdf::Joint::CONTINUOUS) info.kind = JointKind::kContinuous;
    // A <limit> that names only effort and velocity leaves both bounds 0.
    if (info.kind != JointKind::kContinuous && joint.limits && joint.limits->lower < joint.limits->upper)
      info.limits = {joint.limits->lower, joint.limits->upper};
    return info;
  }

  // A joint may mimic one that mimics another.
  void ResolveMimics(UrdfTree& out) {
    for (const urdf::Joint* mimic : mimics_) {
      double factor = 1, offset = 0;
      const urdf::Joint* at = mimic;
      for (size_t steps = 0; at->mimic; ++steps) {
        if (steps > mimics_.size()) return Fail(*mimic, "mimics itself in a circle");
        offset += factor * at->mimic->offset;
        factor *= at->mimic->multiplier;
        const auto followed = model_.joints_.find(at->mimic->joint_name);
        if (followed == model_.joints_.end())
          return Fail(*mimic, "mimics '" + at->mimic->joint_name + "', which is no joint");
        at = followed->second.get();
      }
      const auto rule = out.rules.find(at->name);
      if (rule == out.rules.end()) return Fail(*mimic, "mimics '" + at->name + "', which does not move");
      if (!std::isfinite(factor) || !std::isfinite(offset))
        return Fail(*mimic, "has a <mimic> that is not a number");
      const double unit = mimic->type == urdf::Joint::PRISMATIC ? kMmPerMetre : 1;
      out.rules[mimic->name] = {
          .joint = rule->second.joint, .factor = unit * factor, .offset = unit * offset};
    }
  }

  void Fail(const urdf::Joint& joint, const std::string& what) {
    if (trouble_.empty()) trouble_ = "joint '" + joint.name + "' " + what;
  }

  const urdf::ModelInterface& model_;
  std::vector<const urdf::Joint*> mimics_;
  std::string trouble_;
};

std::string Exceeds(size_t found, const std::string& what, size_t most) {
  return "it has " + std::to_string(found) + " " + what + "; at most " + std::to_string(most) + " are read";
}

/// Why the parser does not get the text; empty: it does. The parser recurses into nested elements, and along
/// a chain of links when it frees them: both would overflow the stack.
std::string Refusal(std::string_view xml) {
  if (xml.size() > kMostTextBytes) return Exceeds(xml.size(), "bytes", kMostTextBytes);
  size_t depth = 0, deepest = 0, elements = 0, links = 0;
  XmlTags tags(xml);
  while (const auto tag = tags.Next()) {
    if (tag->Uses("xacro:")) return "it holds xacro commands; expand it first: xacro FILE.xacro > FILE.urdf";
    if (tag->is_end) {
      depth -= std::min<size_t>(depth, 1);
      continue;
    }
    ++elements;
    deepest = std::max(deepest, depth + 1);
    if (depth == 1 && tag->name == "link") ++links;
    if (!tag->is_empty) ++depth;
  }
  if (deepest > kMaxDepth) return Exceeds(deepest, "levels of nested elements", kMaxDepth);
  if (elements > kMaxElements) return Exceeds(elements, "elements", kMaxElements);
  if (links > kMaxLinks) return Exceeds(links, "links", kMaxLinks);
  return {};
}

}  // namespace

Result<UrdfTree> ReadUrdf(const std::string& name, const std::string& xml) {
  const std::lock_guard lock(ParserMutex());
  const Complaints complaints;
  const auto invalid = [&name](const std::string& what) {
    return Error{ErrorCode::kInvalidArgument, name + ": no valid URDF: " + what};
  };
  if (const std::string refusal = Refusal(xml); !refusal.empty()) return invalid(refusal);
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(xml);
  if (!model || !model->getRoot()) return invalid(complaints.First());
  UrdfTree out;
  const std::string trouble = Reader(*model).Read(out);
  if (!trouble.empty()) return invalid(trouble);
  return out;
}

}  // namespace taclink::server
