#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/log_text.h"
#include "client/command/cli/terminal_style.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"
#include "client/cpp/taclink/recordings.h"
#include "sensing/capture/camera_finder.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

constexpr uint64_t kLeastFreeBytes = uint64_t{2} << 30;
constexpr int kGrpcPort = 50051, kHttpPort = 8080;
// A USB 2 bus moves some 320 Mbit/s of pictures; 640 x 480 pixels of two bytes, 30 a second, are 147.
constexpr int kUncompressedCamerasPerBus = 2;

struct DoctorOptions {
  std::string server = "127.0.0.1:50051";
  std::string config;
};

enum class Verdict { kGood, kNote, kBad };

struct Finding {
  Verdict verdict = Verdict::kGood;
  std::string what, text;
  std::string mend = {};  // what to do; empty: nothing
};

Finding LookAtVersion() {
  return {Verdict::kGood, "version", TACLINK_VERSION};
}

std::vector<Finding> LookAtCameras() {
  std::vector<Finding> findings;
  const std::vector<FoundCamera> cameras = ListCameras();
  if (cameras.empty())
    return {{Verdict::kNote, "cameras", "none on this machine",
             "plug them in; without cameras, simulate: source: simulated"}};
  std::map<std::string, int> on_bus;
  for (const FoundCamera& camera : cameras) {
    const int fd = open(camera.node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd >= 0) close(fd);
    if (fd >= 0)
      findings.push_back({Verdict::kGood, "camera", Describe(camera)});
    else if (errno == EACCES)
      findings.push_back({Verdict::kBad, "camera", camera.node + ": no permission",
                          "sudo usermod -aG video $USER, and log in again"});
    else
      findings.push_back({Verdict::kBad, "camera",
                          camera.node + ": " + std::generic_category().message(errno),
                          "end the program that uses it, or plug it in again"});
    if (!camera.usb_path.empty()) ++on_bus[camera.usb_path.substr(0, camera.usb_path.find('-'))];
  }
  for (const auto& [bus, count] : on_bus) {
    if (count <= kUncompressedCamerasPerBus) continue;
    findings.push_back(
        {Verdict::kNote, "USB bandwidth",
         fmt::format("{} cameras on bus {}: uncompressed, at 640 x 480 and 30/s, a USB 2 bus moves "
                     "the pictures of {}",
                     count, bus, kUncompressedCamerasPerBus),
         "use format: mjpeg, or ports of another bus (lsusb -t)"});
  }
  return findings;
}

Finding LookAtDisk() {
  std::error_code error;
  const auto space = std::filesystem::space(".", error);
  if (error) return {Verdict::kNote, "disk", error.message()};
  const std::string text = SizeText(space.available) + " free here";
  if (space.available >= kLeastFreeBytes) return {Verdict::kGood, "disk", text};
  return {Verdict::kBad, "disk", text, "delete or move old logs: taclink record list, taclink record delete"};
}

Finding LookAtClock() {
  timex state{};
  if (adjtimex(&state) < 0) return {Verdict::kNote, "clock", "its state can't be read"};
  if ((state.status & STA_UNSYNC) == 0) return {Verdict::kGood, "clock", "synchronized"};
  return {Verdict::kNote, "clock", "not synchronized: times of joint states from other machines do not fit",
          "sudo apt install chrony, or systemctl enable --now systemd-timesyncd"};
}

bool IsFree(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return true;
  const int yes = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool is_free = bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  close(fd);
  return is_free;
}

std::vector<Finding> LookAtPorts() {
  std::vector<Finding> findings;
  for (const auto& [port, option] :
       {std::pair{kGrpcPort, "--listen"}, std::pair{kHttpPort, "--http-listen"}}) {
    if (IsFree(port))
      findings.push_back({Verdict::kGood, "port", fmt::format("{} is free", port)});
    else
      findings.push_back(
          {Verdict::kNote, "port", fmt::format("{} is in use, though by no server that answers", port),
           fmt::format("ss -ltnp 'sport = :{}' shows by what; or taclinkd {} 127.0.0.1:PORT", port, option)});
  }
  return findings;
}

Finding LookAtLink(const v1::Link& link) {
  const std::string what = "link " + link.name();
  if (link.status() == v1::LINK_STATUS_OK)
    return {Verdict::kGood, what, fmt::format("ok, {:.1f} frames/s", link.statistics().rate_hz())};
  return {link.status() == v1::LINK_STATUS_LOST ? Verdict::kBad : Verdict::kNote, what,
          std::string(client::Name(link.status())) + ": " + link.status_reason(),
          "docs/troubleshooting.md has each reason"};
}

// No arm is to be had there. Where no server runs on this machine, whether one could start.
std::vector<Finding> LookAtSilence(const std::string& address, const Error& why) {
  const bool is_refusal =
      why.code == ErrorCode::kUnauthenticated || why.code == ErrorCode::kPermissionDenied ||
      why.code == ErrorCode::kFailedPrecondition || why.code == ErrorCode::kInvalidArgument;
  if (is_refusal) return {{Verdict::kBad, "server", why.message, "docs/security.md"}};
  const bool is_here = address.starts_with("127.") || address.starts_with("localhost");
  if (!is_here)
    return {{Verdict::kBad, "server", why.message, "look at the server's machine and the network between"}};
  std::vector<Finding> findings = LookAtPorts();
  findings.push_back({Verdict::kNote, "server", why.message, "deploy/demo, or taclinkd --config FILE"});
  return findings;
}

std::vector<Finding> LookAtServer(const std::string& address) {
  auto connection = ConnectTo(address);
  const auto arm = connection ? connection->GetArm() : Result<v1::Arm>(connection.error());
  if (!arm) return LookAtSilence(address, arm.error());
  std::vector<Finding> findings = {
      {Verdict::kGood, "server",
       fmt::format("{} at {}, arm {}", arm->server_version(), address, arm->name())}};
  if (arm->server_version() != TACLINK_VERSION)
    findings.push_back({Verdict::kNote, "version",
                        "the server is " + arm->server_version() + ", this command " + TACLINK_VERSION,
                        "install both of one version"});
  for (const v1::Link& link : arm->links()) findings.push_back(LookAtLink(link));
  client::Recordings recordings = connection->RecordingCalls();
  if (const auto recorder = recordings.Status(); recorder && !recorder->trouble().empty())
    findings.push_back({Verdict::kBad, "recorder", recorder->trouble(), "docs/logs.md"});
  return findings;
}

// As `taclinkd --check-config` says, whose lines go to the same terminal.
Finding LookAtConfig(const std::string& file) {
  std::error_code error;
  const auto beside = std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "taclinkd";
  const std::string program = !error && std::filesystem::exists(beside) ? beside.string() : "taclinkd";
  const std::string config = "--config", check = "--check-config";
  const std::vector<std::string> words = {program, config, file, check};
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  std::fflush(stdout);
  pid_t child = 0;
  if (posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments.data(), environ) != 0)
    return {Verdict::kNote, "configuration", "taclinkd is not there to check it", "install the server"};
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return {Verdict::kNote, "configuration", "taclinkd's check has no result"};
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return {Verdict::kGood, "configuration", file + " is good"};
  return {Verdict::kBad, "configuration", file + " is refused, see above", "docs/configuration.md"};
}

void Print(const Finding& finding, bool color) {
  const auto [sign, of] = finding.verdict == Verdict::kGood   ? std::pair{"ok  ", Color::kGreen}
                          : finding.verdict == Verdict::kNote ? std::pair{"note", Color::kYellow}
                                                              : std::pair{"err ", Color::kRed};
  fmt::print("{}  {:<14} {}\n", color ? Colored(sign, of) : sign, finding.what, Printable(finding.text));
  if (!finding.mend.empty()) fmt::print("                     -> {}\n", finding.mend);
}

Result<void> RunDoctor(const DoctorOptions& options) {
  const bool color = WantsColor();
  int bad = 0;
  const auto tell = [&](const Finding& finding) {
    Print(finding, color);
    bad += finding.verdict == Verdict::kBad ? 1 : 0;
  };
  tell(LookAtVersion());
  tell(LookAtDisk());
  tell(LookAtClock());
  for (const Finding& finding : LookAtCameras()) tell(finding);
  if (!options.config.empty()) tell(LookAtConfig(options.config));
  for (const Finding& finding : LookAtServer(options.server)) tell(finding);
  if (bad == 0) return {};
  return Error{ErrorCode::kFailedPrecondition,
               fmt::format("{} found", bad == 1 ? "1 problem was" : std::to_string(bad) + " problems were")};
}

}  // namespace

void AddDoctor(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<DoctorOptions>();
  const Arguments command = app.AddCommand("doctor",
                                           "Check cameras, USB, ports, disk, clock, configuration and "
                                           "server, and name the command that corrects each problem");
  AddServerOption(command, options->server);
  command.AddOption("--config", options->config, "A server's configuration file, to check it too");
  command.OnChosen([options, &selected] { selected = [options] { return RunDoctor(*options); }; });
}

}  // namespace taclink::command
