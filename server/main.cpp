#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "sensing/core/file_modes.h"
#include "sensing/core/printable.h"
#include "sensing/core/thread_start.h"
#include "server/assembly/arm_builder.h"
#include "server/assembly/config_check.h"
#include "server/assembly/log_preamble.h"
#include "server/assembly/reload.h"
#include "server/assembly/replayed_arm.h"
#include "server/config/config.h"
#include "server/gateway/setup.h"
#include "server/gateway/static_files.h"
#include "server/process/descriptors.h"
#include "server/process/heap.h"
#include "server/process/log.h"
#include "server/process/signals.h"
#include "server/process/system_limits.h"
#include "server/process/systemd_notify.h"
#include "server/publish/nats_connection.h"
#include "server/publish/publisher.h"
#include "server/recording/recorder.h"
#include "server/rpc/rpc_server.h"
#include "server/security/exposure.h"
#include "server/security/security.h"
#include "server/security/tls_policy.h"

namespace taclink::server {
namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr std::chrono::seconds kLogFlush{10};

struct Options {
  std::string config;
  std::string replay;  // a log in place of the cameras
  std::string listen;
  std::optional<std::string> http_listen;
  bool insecure_open = false;
  std::string log_level, log_format;  // in place of the configured ones
  bool print_config = false;
  bool check_config = false;
  bool print_schema = false;
  bool print_reference = false;
};

// A configuration has a line for each of its errors.
std::vector<std::string> LinesOf(const std::string& message) {
  std::vector<std::string> lines;
  std::istringstream in(message);
  for (std::string line; std::getline(in, line);) lines.push_back(Printable(line));
  return lines;
}

// After what the log still has to say.
int Complain(const std::string& message, int code) {
  EndLog();
  for (const std::string& line : LinesOf(message)) std::fprintf(stderr, "taclinkd: %s\n", line.c_str());
  return code;
}

// The arm is the log's, all else is configured.
Result<Config> WithLog(const std::string& path, Config config) {
  const auto log = OpenReplayedLog(path);
  return log ? ConfigureReplay(*log, std::move(config)) : log.error();
}

Result<Config> Configure(const Options& options) {
  auto config = options.config.empty() ? DemoConfig() : LoadConfig(options.config);
  if (config && !options.replay.empty()) config = WithLog(options.replay, std::move(*config));
  if (!config) return config.error();
  if (!options.listen.empty()) {
    const auto good = CheckListenAddress(options.listen);
    if (!good) return Error{good.error().code, "--listen " + good.error().message};
    config->listen = options.listen;
  }
  if (options.http_listen) {
    const auto good = CheckHttpListen(*options.http_listen);
    if (!good) return Error{good.error().code, "--http-listen " + good.error().message};
    config->http.listen = options.http_listen;
  }
  if (!options.log_level.empty()) config->log.level = options.log_level;
  if (!options.log_format.empty())
    config->log.format = options.log_format == "json" ? LogFormat::kJson : LogFormat::kText;
  return config;
}

// Everything that a change of the configuration can do without a restart.
void AddReloads(Reloader& reloader, RpcServer& server, Arm& arm) {
  reloader.Add(
      "log", [](const Config& next) { return SetUpLog(next.log); }, {},
      Reloader::When::kAlways);  // also reopens its file
  reloader.Add("limits",
               [&server](const Config& next) {
                 server.SetLimits(ToServiceLimits(next.limits));
                 return Result<void>();
               },
               {"max_links", "max_connections", "max_connections_per_peer", "max_calls_per_connection",
                "max_message_kb", "memory_mb", "keepalive_s", "keepalive_timeout_s", "handshake_timeout_s",
                "idle_timeout_s", "max_frame_age_s"});
  reloader.AddAlways("links", [&arm](const Config&) {
    for (size_t link = 0; link < arm.links().size(); ++link) arm.worker(link).Wake();
    return Result<void>();
  });
}

std::string Joined(const std::vector<std::string>& words) {
  return words.empty() ? "nothing" : fmt::format("{}", fmt::join(words, ", "));
}

// Logged by who calls.
void Audit(Arm& arm, const std::string& what, bool accepted, const std::string& outcome) {
  arm.events().Audit(what, {.who = "server", .accepted = accepted, .outcome = outcome, .values = {}});
}

void Reload(const Options& options, Reloader& reloader, Security& security, Arm& arm,
            const SystemdNotifier& systemd) {
  const int64_t now_us = SystemClock().MonotonicNs() / 1000;
  systemd.Send("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(now_us));
  if (const auto next = Configure(options); !next) {
    const std::vector<std::string> lines = LinesOf(next.error().message);
    for (const std::string& line : lines) SPDLOG_ERROR("SIGHUP: the configuration in use stays: {}", line);
    Audit(arm, "configuration", false,
          fmt::format("the configuration in use stays: {}", fmt::join(lines, "; ")));
  } else {
    const Reloader::Outcome outcome = reloader.Reload(*next);
    for (const auto& error : outcome.errors) SPDLOG_ERROR("SIGHUP: {}", error);
    security.Reload();
    const std::string text = fmt::format("taken over: {}; needs a restart: {}; changed keys: {}; access: {}",
                                         Joined(outcome.applied), Joined(outcome.needs_restart),
                                         Joined(outcome.keys), Joined(security.TakeChanges()));
    SPDLOG_INFO("SIGHUP: {}", text);
    Audit(arm, "configuration", outcome.errors.empty(),
          outcome.errors.empty() ? text : Joined(outcome.errors) + "; " + text);
  }
  systemd.Send("READY=1");
}

// systemd hears of life only while the watchdog finds every link looked after.
void PingSystemd(Arm& arm, const SystemdNotifier& systemd) {
  if (systemd.watchdog_ns() == 0) return;
  arm.watchdog().OnRound([&systemd, last_ns = int64_t{0}]() mutable {
    const int64_t now_ns = SystemClock().MonotonicNs();
    if (now_ns - last_ns < systemd.watchdog_ns() / 4) return;
    last_ns = now_ns;
    systemd.Send("WATCHDOG=1");
  });
}

// The configured one, or the log's.
Result<ReplayedArm> MakeArm(const Options& options, const Config& config) {
  if (options.replay.empty()) {
    auto arm = BuildArm(config, SystemClock());
    if (!arm) return arm.error();
    return ReplayedArm{
        .arm = std::move(*arm), .joints = nullptr, .preamble = MakePreamble(config, TACLINK_VERSION)};
  }
  const auto log = OpenReplayedLog(options.replay);
  if (!log) return log.error();
  SPDLOG_INFO("playing {} in place of cameras, again and again", options.replay);
  return BuildReplayedArm(*log, config, TACLINK_VERSION, SystemClock());
}

// Null: nothing is to be published.
Result<std::unique_ptr<Publisher>> StartPublisher(Arm& arm, const PublishConfig& config) {
  if (config.url.empty()) return std::unique_ptr<Publisher>();
  SPDLOG_INFO("publishing to {} as taclink.{}.>", config.url, config.site);
  return Publisher::Start(arm, config);
}

Result<void> Run(const Options& options, const Config& config) {
  Signals signals;
  const SystemdNotifier systemd = SystemdNotifier::FromEnvironment();
  const auto security = Security::Load(config.security);
  if (!security) return security.error();
  const auto made = MakeArm(options, config);
  if (!made) return made.error();
  Arm& arm = *made->arm;
  (*security)->Listen([&arm](bool good, const std::string& what) { Audit(arm, "access", good, what); });
  Recorder recorder(arm, config.recording, made->preamble);
  const auto server =
      RpcServer::Start(config.listen, arm, ToServiceLimits(config.limits), *security, &recorder);
  if (!server) return server.error();
  auto publisher = StartPublisher(arm, config.publish);
  if (!publisher) return publisher.error();
  const auto gateway = StartGateway(config.http, arm, **server, *security, publisher->get());
  if (!gateway) return gateway.error();
  const std::jthread watch = (*security)->Watch();
  PingSystemd(arm, systemd);
  if (options.replay.empty()) recorder.Open();  // before the first frame
  arm.Start();
  Reloader reloader(config);
  AddReloads(reloader, **server, arm);
  signals.OnReload([&] { Reload(options, reloader, **security, arm, systemd); });
  SPDLOG_INFO("taclinkd {}: arm {} with {} links, listening on {}", TACLINK_VERSION, config.arm_name,
              config.links.size(), (*server)->address());
  systemd.Send("READY=1\nSTATUS=listening on " + (*server)->address());
  SPDLOG_INFO("{}: shutting down", signals.WaitForStop());
  systemd.Send("STOPPING=1");
  if (*gateway) (*gateway)->Drain();
  (*server)->Shutdown("server is shutting down", config.shutdown.limit);
  arm.Stop();
  if (*publisher) (*publisher)->Close(config.shutdown.limit);
  recorder.Close();
  SPDLOG_INFO("stopped");
  bool leaves_threads = DetachedThreads() > 0;  // such as one whose camera does not open
  for (size_t link = 0; link < config.links.size(); ++link)
    leaves_threads = leaves_threads || arm.worker(link).LeavesThreads();
  if (leaves_threads) {
    EndLog();
    std::_Exit(0);  // such a thread may yet use what exit() destroys
  }
  return {};
}

int Check(const Options& options, const Config& config) {
  if (const auto log = SetUpLog({.level = "warning"}); !log) return Complain(log.error().message, kFailed);
  ConfigFindings findings = CheckConfig(config, options.insecure_open);
  if (!config.publish.url.empty())
    if (const auto publish = CheckPublish(config.publish); !publish)
      findings.errors.push_back(publish.error().message);
  if (const auto page = StaticFiles::Open(config.http.web_root); !page)
    findings.errors.push_back(page.error().message);
  EndLog();
  for (const auto& note : findings.notes)
    std::fprintf(stderr, "taclinkd: note: %s\n", Printable(note).c_str());
  for (const auto& error : findings.errors) Complain(error, kFailed);
  if (!findings.errors.empty()) return kFailed;
  std::printf("OK\n");
  return 0;
}

void AddOptions(CLI::App& app, Options& options) {
  app.set_version_flag("--version", std::string(TACLINK_VERSION));
  app.add_option("--config", options.config, "Configuration file (default: a simulated arm of four links)")
      ->check([](const std::string& path) { return path.empty() ? "must name a file" : std::string(); }, "");
  CLI::Option* replay = app.add_option(
      "--replay", options.replay,
      "Log to play again and again in place of the cameras; the arm is the one that it describes");
  app.add_option("--listen", options.listen,
                 "Address to listen on, in place of the configured one; port 0: any");
  app.add_option("--http-listen", options.http_listen,
                 "Address of the web page, in place of the configured one; port 0: any; '': none");
  app.add_flag("--insecure-open", options.insecure_open,
               "Allow other addresses than loopback without encryption or without tokens");
  app.add_flag("--print-config", options.print_config, "Print the effective configuration and exit");
  app.add_flag("--check-config", options.check_config,
               "Make all that the configuration names, say OK or all that is wrong, and exit")
      ->excludes(replay);
  app.add_flag("--print-schema", options.print_schema, "Print the JSON schema of the configuration and exit");
  app.add_flag("--print-config-reference", options.print_reference,
               "Print all keys of the configuration as a page of Markdown (docs/configuration.md) and exit");
  app.add_option("--log-level", options.log_level, "In place of the configured one")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}));
  app.add_option("--log-format", options.log_format, "In place of the configured one")
      ->check(CLI::IsMember({"text", "json"}));
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("Serves the soft tactile links of an arm over gRPC", "taclinkd");
  AddOptions(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    std::string what = e.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    return Complain(what + "; see taclinkd --help", kUsage);
  }
  if (options.print_schema || options.print_reference) {
    std::fputs((options.print_schema ? ConfigSchema() : ConfigReference()).c_str(), stdout);
    return 0;
  }
  // gRPC's own messages are for its developers.
  gpr_set_log_function([](gpr_log_func_args* args) {
    spdlog::log({args->file, args->line, ""}, spdlog::level::debug, "grpc: {}", args->message);
  });
  const auto config = Configure(options);
  if (!config) return Complain(config.error().message, kFailed);
  if (options.print_config) {
    std::fputs(ConfigText(*config).c_str(), stdout);
    return 0;
  }
  if (options.check_config) return Check(options, *config);
  if (const auto log = SetUpLog(config->log); !log) return Complain(log.error().message, kFailed);
  try {
    spdlog::flush_every(kLogFlush);  // also tells what the rate limit swallowed
  } catch (const std::system_error& e) {
    return Complain(NoThread("flushing the log", e.code().message()).message, kFailed);
  }
  const auto exposure = CheckExposure(*config, options.insecure_open);
  if (!exposure) return Complain(exposure.error().message, kFailed);
  for (const std::string& warning : *exposure) SPDLOG_WARN("{}", warning);
  const auto ran = Run(options, *config);
  return ran ? 0 : Complain(ran.error().message, kFailed);
}

}  // namespace
}  // namespace taclink::server

int main(int argc, char** argv) {
  taclink::KeepFilesFromOthers();
  taclink::server::LimitGrpcCiphers();
  taclink::server::ReturnLargeBlocks();
  taclink::server::RaiseDescriptorLimit();
  std::signal(SIGPIPE, SIG_IGN);  // whoever reads the log, or another output, may go away
  try {
    const int code = taclink::server::Main(argc, argv);
    taclink::server::EndLog();
    return code;
  } catch (const std::exception& e) {
    taclink::server::EndLog();
    std::fprintf(stderr, "taclinkd: failed unexpectedly: %s\n",
                 taclink::Printable(taclink::server::DescribeLimit(e)).c_str());
    return 1;
  }
}
