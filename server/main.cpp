#include <grpc/support/log.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include "server/assembly/arm_builder.h"
#include "server/config.h"
#include "server/rpc/rpc_server.h"

namespace taclink::server {
namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr std::chrono::milliseconds kShutdownPatience{1000};

struct Options {
  std::string config;
  std::string listen;
  bool insecure_open = false;
  bool print_config = false;
};

int Complain(std::string message, int code) {
  for (char& c : message) c = c == '\n' ? ' ' : c;
  std::fprintf(stderr, "taclinkd: %s\n", message.c_str());
  return code;
}

void SetUpLog() {
  spdlog::set_default_logger(spdlog::stderr_color_mt("taclinkd"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  // gRPC's own messages are for its developers.
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("grpc: {}", args->message); });
}

Result<Config> Configure(const Options& options) {
  auto config = options.config.empty() ? DemoConfig() : LoadConfig(options.config);
  if (!config) return config.error();
  if (!options.listen.empty()) {
    const auto good = CheckListenAddress(options.listen);
    if (!good) return Error{good.error().code, "--listen " + good.error().message};
    config->listen = options.listen;
  }
  return config;
}

// Without TLS everyone who can connect sees everything.
Result<void> CheckOpen(const Config& config, bool insecure_open) {
  if (IsLoopback(config.listen)) return {};
  if (!insecure_open) {
    return Error{
        ErrorCode::kInvalidArgument,
        "refusing to listen on " + config.listen +
            " without encryption; use a loopback address, or --insecure-open if the network is trusted"};
  }
  spdlog::warn(
      "LISTENING ON {} WITHOUT ENCRYPTION OR AUTHENTICATION: anyone who can reach it can use this server",
      config.listen);
  return {};
}

// SIGTERM and SIGINT; returns the signal's name.
std::string WaitForSignal() {
  boost::asio::io_context context;
  boost::asio::signal_set signals(context, SIGINT, SIGTERM);
  std::string name;
  signals.async_wait(
      [&](const boost::system::error_code&, int number) { name = number == SIGTERM ? "SIGTERM" : "SIGINT"; });
  context.run();
  return name;
}

Result<void> Run(const Config& config) {
  const auto arm = BuildArm(config, SystemClock());
  if (!arm) return arm.error();
  const auto server = RpcServer::Start(config.listen, **arm,
                                       {.max_streams = static_cast<size_t>(config.limits.max_streams),
                                        .queue_messages = static_cast<size_t>(config.limits.queue_messages)});
  if (!server) return server.error();
  (*arm)->Start();
  spdlog::info("taclinkd {}: arm {} with {} links, listening on {}", TACLINK_VERSION, config.arm_name,
               config.links.size(), (*server)->address());
  spdlog::info("{}: shutting down", WaitForSignal());
  (*server)->Shutdown("server is shutting down", kShutdownPatience);
  (*arm)->Stop();
  spdlog::info("stopped");
  return {};
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("Serves the soft tactile links of an arm over gRPC", "taclinkd");
  app.set_version_flag("--version", std::string(TACLINK_VERSION));
  app.add_option("--config", options.config, "Configuration file (default: a simulated arm of four links)");
  app.add_option("--listen", options.listen,
                 "Address to listen on, in place of the configured one; port 0: any");
  app.add_flag("--insecure-open", options.insecure_open,
               "Allow other addresses than loopback without encryption");
  app.add_flag("--print-config", options.print_config, "Print the effective configuration and exit");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    return Complain(std::string(e.what()) + "; see taclinkd --help", kUsage);
  }
  SetUpLog();
  const auto config = Configure(options);
  if (!config) return Complain(config.error().message, kFailed);
  if (options.print_config) {
    std::fputs(ConfigText(*config).c_str(), stdout);
    return 0;
  }
  if (const auto open = CheckOpen(*config, options.insecure_open); !open)
    return Complain(open.error().message, kFailed);
  const auto ran = Run(*config);
  return ran ? 0 : Complain(ran.error().message, kFailed);
}

}  // namespace
}  // namespace taclink::server

int main(int argc, char** argv) {
  try {
    return taclink::server::Main(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "taclinkd: failed unexpectedly: %s\n", e.what());
    return 1;
  }
}
