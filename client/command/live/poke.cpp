#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/cli/json.h"
#include "client/command/cli/units.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

constexpr double kOtherBodyM = 0.025;  // a contact further from a body's pieces is not that body's
constexpr double kLineS = 0.5;
constexpr double kRadPerDeg = std::numbers::pi / 180;

struct PokeOptions {
  std::string server = "127.0.0.1:50051";
  std::string link;
  std::string body = "finger";
  std::optional<double> angle_deg, z_mm, depth_mm, force_n, diameter_mm, pressure_kpa, joint_deg;
  double hold_s = 3;
  uint64_t id = 1;
  bool stay = false, release = false, json = false;

  bool presses() const { return depth_mm || force_n; }
};

/// A body as it is, and as the link feels it.
struct Felt {
  double true_n = 0, found_n = 0;  // pressing, over its pieces
  Eigen::Vector3d true_m = Eigen::Vector3d::Zero(), found_m = Eigen::Vector3d::Zero();  // centers, times N
};

Eigen::Vector3d VectorOf(const v1::Vector3& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

Felt FeltOf(const v1::LinkFrame& frame, uint64_t body_id) {
  Felt felt;
  for (const v1::AppliedContact& piece : frame.simulation().contacts()) {
    if (piece.body_id() != body_id) continue;
    const double n = VectorOf(piece.force_n()).norm();
    felt.true_n += n;
    felt.true_m += n * VectorOf(piece.center_m());
  }
  for (const v1::Contact& contact : frame.contacts()) {
    double own = std::numeric_limits<double>::infinity(), others = own;
    for (const v1::AppliedContact& piece : frame.simulation().contacts()) {
      double& least = piece.body_id() == body_id ? own : others;
      least = std::min(least, (VectorOf(piece.center_m()) - VectorOf(contact.center_m())).norm());
    }
    if (own > kOtherBodyM || others < own) continue;
    felt.found_n += contact.normal_force_n();
    felt.found_m += contact.normal_force_n() * VectorOf(contact.center_m());
  }
  return felt;
}

double OffMm(const Felt& felt) {
  return kMmPerMetre * (felt.found_m / felt.found_n - felt.true_m / felt.true_n).norm();
}

void PrintJson(const v1::LinkFrame& frame, const Felt& felt) {
  Json line = {{"link", frame.link()},
               {"sequence", frame.sequence()},
               {"status", client::Name(frame.status())},
               {"felt_n", felt.found_n},
               {"true_n", felt.true_n},
               {"off_mm", nullptr},
               {"trouble", frame.simulation().trouble()}};
  if (felt.found_n > 0 && felt.true_n > 0) line["off_mm"] = OffMm(felt);
  fmt::print("{}\n", line.dump());
}

void PrintText(const v1::LinkFrame& frame, const Felt& felt) {
  std::string line = felt.found_n > 0 ? fmt::format("{:.2f} N felt", felt.found_n) : "nothing felt";
  line += fmt::format(", true {:.2f} N", felt.true_n);
  if (felt.found_n > 0 && felt.true_n > 0) line += fmt::format("; {:.1f} mm off", OffMm(felt));
  if (!frame.status_reason().empty()) line += "  (" + frame.status_reason() + ")";
  if (!frame.simulation().trouble().empty()) line += "  [" + frame.simulation().trouble() + "]";
  fmt::print("{}\n", line);
}

Result<void> Follow(client::Client& connection, const PokeOptions& options) {
  v1::StreamFramesRequest request;
  request.add_links(options.link);
  auto reader = connection.StreamFrames(request);
  if (!reader) return reader.error();
  const auto begin = std::chrono::steady_clock::now();
  double next_s = kLineS;
  while (!IsInterrupted()) {
    const double passed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (passed_s > options.hold_s) return {};
    const auto frame = (*reader)->Next(kInterruptPoll);
    if (!frame && frame.error().code == ErrorCode::kTimeout) continue;
    if (!frame) return frame.error();
    if (passed_s < next_s) continue;
    next_s += kLineS;
    (options.json ? PrintJson : PrintText)(*frame, FeltOf(*frame, options.id));
    std::fflush(stdout);
  }
  return {};
}

Result<void> PressBody(client::Client& connection, const PokeOptions& options) {
  v1::PressRequest request;
  request.set_link(options.link);
  request.set_body_id(options.id);
  request.set_shape(*client::ValueOf<v1::BodyShape>(options.body));
  if (options.diameter_mm) request.set_diameter_m(*options.diameter_mm / kMmPerMetre);
  request.set_angle_rad(kRadPerDeg * options.angle_deg.value_or(0));
  request.set_z_m(*options.z_mm / kMmPerMetre);
  if (options.depth_mm)
    request.set_depth_m(*options.depth_mm / kMmPerMetre);
  else
    request.set_force_n(*options.force_n);
  // Goes away by itself if this command is killed.
  if (!options.stay) request.set_hold_s(options.hold_s + 1);
  if (auto pressed = connection.Press(request); !pressed) return pressed;
  CatchInterrupts();
  auto followed = Follow(connection, options);
  if (options.stay) return followed;
  auto released = connection.Release(options.link, options.id);
  return followed ? released : followed;
}

Result<void> RunPoke(const PokeOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  if (options.release) {
    if (auto released = connection->Release(options.link); !released) return released;
    v1::SetScenePressureRequest pressure;
    pressure.set_link(options.link);
    if (auto set = connection->SetScenePressure(pressure); !set) return set;
    v1::MoveSceneJointRequest joint;
    joint.set_link(options.link);
    if (auto moved = connection->MoveSceneJoint(joint); !moved) return moved;
  }
  if (options.pressure_kpa) {
    v1::SetScenePressureRequest request;
    request.set_link(options.link);
    request.set_pressure_pa(1e3 * *options.pressure_kpa);
    if (auto set = connection->SetScenePressure(request); !set) return set;
  }
  if (options.joint_deg) {
    v1::MoveSceneJointRequest request;
    request.set_link(options.link);
    request.set_position_rad(kRadPerDeg * *options.joint_deg);
    if (auto moved = connection->MoveSceneJoint(request); !moved) return moved;
  }
  return options.presses() ? PressBody(*connection, options) : Result<void>();
}

}  // namespace

void AddPoke(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<PokeOptions>();
  const Arguments command =
      app.AddCommand("poke", "Press a body on a simulated link, and compare what is felt with what is true");
  AddServerOption(command, options->server);
  command.AddOption("--link", options->link, "Name of the link").Required();
  command.AddOption("--body", options->body, "finger, sphere, disc, plate or hand")
      .Must(OneOf(client::Names<v1::BodyShape>()))
      .ShowDefault();
  command.AddOption("--diameter", options->diameter_mm, "Of a sphere or a disc, mm (11)").Must(Positive());
  command.AddOption("--angle", options->angle_deg, "Where around the axis, from +x towards +y, degrees (0)");
  command.AddOption("--z", options->z_mm, "Where along the axis, mm").Must(Positive());
  const Option depth =
      command.AddOption("--depth", options->depth_mm, "How deep from where it first touches, mm")
          .Must(Positive());
  command.AddOption("--force", options->force_n, "How hard along the skin's normal, N")
      .Must(Positive())
      .Excludes(depth);
  command.AddOption("--hold", options->hold_s, "Remove the body after so many seconds")
      .Must(Positive())
      .ShowDefault();
  const Option stay = command.AddFlag("--stay", options->stay, "Leave it there until --release");
  command.AddOption("--id", options->id, "Of the body, so that several can press").ShowDefault();
  command.AddOption("--pressure", options->pressure_kpa, "Set the pressure inside the skin, kPa");
  command.AddOption("--joint", options->joint_deg,
                    "Move the joint that swings the link in its scene, degrees");
  command.AddFlag("--json", options->json, "One JSON object a line");
  command
      .AddFlag("--release", options->release, "Take all bodies off; pressure and joint back to the scene's")
      .Excludes(stay);
  command.OnChosen([options, &selected] {
    if (!options->presses() && !options->release && !options->pressure_kpa && !options->joint_deg)
      RefuseMissing("what to do: --depth or --force with --z; --pressure, --joint or --release");
    if (options->presses() && !options->z_mm) RefuseMissing("--z: where along the axis to press, mm");
    selected = [options] { return RunPoke(*options); };
  });
}

}  // namespace taclink::command
