#include "server/assembly/arm_builder.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "sensing/core/fingerprint.h"
#include "sensing/core/thread_start.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/state_estimator.h"
#include "sensing/simulation/scene.h"
#include "server/assembly/attitude_factory.h"
#include "server/assembly/pressure_factory.h"
#include "server/assembly/processor_factory.h"
#include "server/assembly/source_factory.h"
#include "server/hub/encoder.h"
#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

/// How a link's forces are computed: as configured, until somebody chooses otherwise.
class ChosenForceModel {
 public:
  explicit ChosenForceModel(std::optional<ForceModel> configured) : model_(configured) {}

  void Set(std::optional<ForceModel> model) {
    const std::lock_guard lock(mutex_);
    model_ = model;
  }
  LinkConfig In(LinkConfig link) const {
    const std::lock_guard lock(mutex_);
    link.force_model = model_;
    return link;
  }

 private:
  mutable std::mutex mutex_;
  std::optional<ForceModel> model_;  // guarded by mutex_; none: by tolerance, frame by frame
};

bool HasPressure(const Scene& scene) {
  return std::ranges::any_of(scene.pressure, [](const PressureKey& key) { return key.kpa != 0; });
}

// A scene whose skin a simulated regulator can inflate.
Result<void> CheckRegulated(const Scene& scene) {
  if (scene.skin == SkinKind::kLinear)
    return Error{ErrorCode::kInvalidArgument,
                 "scene '" + scene.name +
                     "' has a linear skin, which a simulated regulator cannot inflate; use "
                     "a scene with a nonlinear one"};
  if (HasPressure(scene))
    return Error{ErrorCode::kInvalidArgument,
                 "scene '" + scene.name +
                     "' inflates the skin itself, and so does the link's regulator; use a "
                     "scene without pressure"};
  return {};
}

// Null: the link is not simulated.
Result<std::shared_ptr<SimulationDesk>> MakeDesk(const LinkConfig& link, const LinkModel& model, Clock& clock,
                                                 std::shared_ptr<SimulatedRegulator> regulator) {
  const auto* simulated = std::get_if<SimulatedSourceConfig>(&link.source);
  if (simulated == nullptr) return std::shared_ptr<SimulationDesk>();
  auto scene = LoadScene(simulated->scene);
  if (!scene) return scene.error();
  if (regulator != nullptr)
    if (const auto good = CheckRegulated(*scene); !good) return good.error();
  return std::make_shared<SimulationDesk>(model, *std::move(scene), clock, std::move(regulator));
}

Result<bool> IsInflatedByScene(const LinkConfig& link) {
  const auto* simulated = std::get_if<SimulatedSourceConfig>(&link.source);
  if (simulated == nullptr) return false;
  const auto scene = LoadScene(simulated->scene);
  if (!scene) return scene.error();
  return HasPressure(*scene);
}

// The joint that a simulated link's scene moves is one of the arm's, within its range.
Result<void> CheckSceneJoint(const LinkConfig& link, const ArmKinematics& kinematics) {
  const auto* simulated = std::get_if<SimulatedSourceConfig>(&link.source);
  if (simulated == nullptr) return {};
  const auto scene = LoadScene(simulated->scene);
  if (!scene) return scene.error();
  if (!scene->motion || !scene->motion->swing || scene->motion->swing->joint.empty()) return {};
  const Swing& swing = *scene->motion->swing;
  const std::string where =
      "link '" + link.name + "': scene '" + scene->name + "': swing.joint '" + swing.joint;
  const auto joint = std::ranges::find(kinematics.joints(), swing.joint, &JointInfo::name);
  if (joint == kinematics.joints().end()) {
    std::string names;
    for (const JointInfo& each : kinematics.joints()) names += (names.empty() ? "" : ", ") + each.name;
    return Error{ErrorCode::kInvalidArgument, where + "' is no joint of the arm's URDF (" + names + ")"};
  }
  const double low = swing.mean_rad - swing.amplitude_rad, high = swing.mean_rad + swing.amplitude_rad;
  if (joint->limits && (low < joint->limits->lower || high > joint->limits->upper)) {
    return Error{ErrorCode::kInvalidArgument,
                 where + "' swings beyond the range that the arm's URDF gives it; use a smaller amplitude"};
  }
  return {};
}

// SourceKind names the alternatives of SourceConfig in their order.
static_assert(std::variant_size_v<SourceConfig> == static_cast<size_t>(SourceKind::kLog));

std::string HashOfModel(const std::string& name_or_path) {
  const auto text = LinkModelText(name_or_path);
  return text ? Fingerprint(*text) : "";
}

Result<LinkParts> BuildLink(const LinkConfig& link, Clock& clock) {
  auto model = LoadLinkModel(link.model);
  if (!model) return model.error();
  if (const auto good = CheckRules(link.rules, model->markers); !good) return good.error();
  const auto inflated = IsInflatedByScene(link);
  if (!inflated) return inflated.error();
  if (const auto good = CheckForceModel(link, *inflated); !good)
    return Error{good.error().code, "force_model " + good.error().message};
  const auto chosen = std::make_shared<ChosenForceModel>(link.force_model);
  const auto regulator = MakeSimulatedRegulator(link, clock);
  const auto desk = MakeDesk(link, *model, clock, regulator);
  if (!desk) return desk.error();
  HandlingNow handling;
  if (*desk != nullptr) handling = [shared = *desk] { return shared->Now(); };
  const LinkFactories factories = {
      .source = [link, model = *model, &clock, handling] { return MakeSource(link, model, clock, handling); },
      .processor = [link, model = *model, chosen] { return MakeProcessor(chosen->In(link), model); },
      .estimator = [link, model = *model, is_inflated = *inflated](
                       std::optional<ForceModel> force_model) -> Result<std::shared_ptr<StateEstimator>> {
        LinkConfig changed = link;
        changed.force_model = force_model;
        if (auto good = CheckForceModel(changed, is_inflated); !good)
          return Error{good.error().code, "the force model " + good.error().message};
        return std::shared_ptr<StateEstimator>(MakeStateEstimator(model, ToPipelineOptions(changed).force));
      },
      .choose = [chosen](std::optional<ForceModel> force_model) { chosen->Set(force_model); }};
  auto source = factories.source();
  if (!source) return source.error();
  auto processor = factories.processor();
  if (!processor) return processor.error();
  return LinkParts{.description = {.name = link.name,
                                   .model = std::move(*model),
                                   .base_from_link = link.FrameFromLink(),
                                   .frame = link.frame,
                                   .source = static_cast<SourceKind>(link.source.index()),
                                   .rules = link.rules,
                                   .model_hash = HashOfModel(link.model)},
                   .source = std::move(*source),
                   .processor = std::move(*processor),
                   .pressure = MakePressure(link, clock, regulator),
                   .simulation = *desk,
                   .factories = factories,
                   .realtime = link.realtime};
}

// What building a link throws is that link's error.
template <typename Build>
Result<LinkParts> Guarded(Build build) {
  try {
    return build();
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInternal, DescribeLimit(e)};
  }
}

}  // namespace

Result<std::unique_ptr<ArmPoses>> BuildPoses(const Config& config) {
  if (!config.kinematics.urdf) return std::unique_ptr<ArmPoses>();
  auto kinematics = ArmKinematics::Load(*config.kinematics.urdf, config.kinematics.base);
  if (!kinematics) return kinematics.error();
  return MakePoses(config, std::move(*kinematics));
}

Result<std::unique_ptr<ArmPoses>> MakePoses(const Config& config,
                                            std::shared_ptr<const ArmKinematics> kinematics) {
  std::vector<LinkMount> mounts;
  for (const LinkConfig& link : config.links) {
    mounts.push_back({.frame = {}, .frame_from_link = link.FrameFromLink()});
    if (link.frame.empty()) continue;
    const auto frame = kinematics->FindFrame(link.frame);
    if (!frame) {
      return Error{frame.error().code,
                   "link '" + link.name + "': " + frame.error().message + "; correct its pose.frame"};
    }
    mounts.back().frame = *frame;
  }
  return std::make_unique<ArmPoses>(std::move(kinematics), std::move(mounts), config.kinematics.joint_states);
}

std::vector<Result<LinkParts>> BuildLinks(const Config& config, Clock& clock) {
  // Simulated links solve their scenes first.
  std::vector<Result<LinkParts>> links;
  for (const LinkConfig& link : config.links) links.emplace_back(Error{ErrorCode::kInternal, link.name});
  {
    std::vector<std::jthread> threads;
    for (size_t i = 0; i < links.size(); ++i) {
      auto thread = StartThread("build:" + config.links[i].name, [&, i] {
        links[i] = Guarded([&] { return BuildLink(config.links[i], clock); });
      });
      if (thread) {
        threads.push_back(*std::move(thread));
      } else {
        links[i] = thread.error();
      }
    }
  }  // joins
  for (size_t i = 0; i < links.size(); ++i) {
    if (links[i]) continue;
    const Error& error = links[i].error();
    links[i] = Error{error.code, "link '" + config.links[i].name + "': " + error.message};
  }
  return links;
}

Result<std::unique_ptr<Arm>> BuildArm(const Config& config, Clock& clock) {
  auto poses = BuildPoses(config);
  if (!poses) return poses.error();
  for (const LinkConfig& link : config.links) {
    if (*poses == nullptr || (*poses)->kinematics() == nullptr) break;
    if (const auto good = CheckSceneJoint(link, *(*poses)->kinematics()); !good) return good.error();
  }
  std::vector<LinkParts> links;
  std::vector<std::string> names;
  for (auto& parts : BuildLinks(config, clock)) {
    if (!parts) return parts.error();
    names.push_back(parts->description.name);
    parts->attitude = MakeAttitude(config, links.size(), poses->get(), parts->description.model.length_mm);
    links.push_back(std::move(*parts));
  }
  return std::make_unique<Arm>(config.arm_name, std::move(links), MakeEncoder(names), clock,
                               ArmOptions{.worker = {.age_limit = AgeLimit{config.limits.max_frame_age}},
                                          .watchdog = config.watchdog,
                                          .events = config.events,
                                          .acceptance_folder = config.acceptance.folder},
                               std::move(*poses));
}

}  // namespace taclink::server
