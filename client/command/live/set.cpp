#include <fmt/format.h>

#include <memory>
#include <optional>

#include "client/command/cli/commands.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

struct SetOptions {
  std::string server = "127.0.0.1:50051";
  std::string link, camera;
  std::optional<std::string> force_model;
  std::optional<double> exposure_ms;
  std::optional<int> gain;
  bool automatic_exposure = false;

  bool any_camera() const { return automatic_exposure || exposure_ms || gain; }
};

Result<void> RunSet(const SetOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  if (options.any_camera()) {
    v1::SetCameraRequest request;
    request.set_link(options.link);
    request.set_camera(options.camera);
    if (options.automatic_exposure) request.set_automatic(true);
    if (options.exposure_ms) request.set_exposure_s(*options.exposure_ms * 1e-3);
    if (options.gain) request.set_gain(*options.gain);
    if (auto set = connection->SetCamera(request); !set) return set;
    fmt::print("link {}: {} set\n", options.link,
               options.camera.empty() ? "both cameras are" : options.camera + " camera is");
  }
  if (options.force_model) {
    const auto model = *client::ValueOf<v1::ForceModel>(*options.force_model);
    if (auto set = connection->SetForceModel(options.link, model); !set) return set;
    fmt::print("link {}: forces are computed by the {} model\n", options.link,
               *options.force_model == "auto" ? "cheapest good enough" : *options.force_model);
  }
  return {};
}

}  // namespace

void AddSet(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<SetOptions>();
  const Arguments command =
      app.AddCommand("set", "Set a link's cameras or its force model until the server ends");
  AddServerOption(command, options->server);
  command.AddOption("--link", options->link, "Name of the link").Required();
  command
      .AddOption("--force-model", options->force_model,
                 "Name of the model; auto: the cheapest that is good enough")
      .Must(OneOf(client::Names<v1::ForceModel>()));
  command.AddOption("--camera", options->camera, "top or bottom (default: both)")
      .Must(OneOf({"top", "bottom"}));
  const Option exposure =
      command.AddOption("--exposure", options->exposure_ms, "Exposure time, ms, in steps of 0.1")
          .Must(Within(0.1, 1000));
  command.AddFlag("--auto-exposure", options->automatic_exposure, "The camera decides").Excludes(exposure);
  command.AddOption("--gain", options->gain, "In the camera's own units");
  command.OnChosen([options, &selected] {
    if (!options->any_camera() && !options->camera.empty())
      RefuseMissing("--camera also needs --exposure, --auto-exposure or --gain");
    if (!options->any_camera() && !options->force_model)
      RefuseMissing("what to set: --force-model, --exposure, --auto-exposure or --gain");
    selected = [options] { return RunSet(*options); };
  });
}

}  // namespace taclink::command
