#include "server/process/systemd_notify.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "tests/support/service_manager.h"

namespace taclink::server {
namespace {

TEST(SystemdNotify, SpeaksToPathsAndAbstractNames) {
  const std::string path = std::filesystem::temp_directory_path() / ("notify." + std::to_string(getpid()));
  const std::string abstract = "@taclink-notify-test-" + std::to_string(getpid());
  for (const std::string& name : {path, abstract}) {
    const ServiceManager manager(name);
    const SystemdNotifier notifier(name, 0);
    EXPECT_TRUE(notifier.Send("READY=1\nSTATUS=well"));
    EXPECT_EQ(manager.Received(), "READY=1\nSTATUS=well");
    EXPECT_EQ(manager.Received(), "nothing");
  }
  std::filesystem::remove(path);
}

TEST(SystemdNotify, NobodyListens) {
  EXPECT_FALSE(SystemdNotifier("", 0).Send("READY=1"));
  EXPECT_FALSE(SystemdNotifier("/no/such/socket", 0).Send("READY=1"));
  EXPECT_FALSE(SystemdNotifier(std::string(200, 'x'), 0).Send("READY=1")) << "longer than an address may be";
}

TEST(SystemdNotify, ReadsTheEnvironment) {
  setenv("WATCHDOG_USEC", "30000000", 1);
  setenv("WATCHDOG_PID", std::to_string(getpid()).c_str(), 1);
  EXPECT_EQ(SystemdNotifier::FromEnvironment().watchdog_ns(), 30'000'000'000);
  setenv("WATCHDOG_PID", "1", 1);
  EXPECT_EQ(SystemdNotifier::FromEnvironment().watchdog_ns(), 0) << "meant for another process";
  unsetenv("WATCHDOG_PID");
  setenv("WATCHDOG_USEC", "soon", 1);
  EXPECT_EQ(SystemdNotifier::FromEnvironment().watchdog_ns(), 0);
  unsetenv("WATCHDOG_USEC");
}

}  // namespace
}  // namespace taclink::server
