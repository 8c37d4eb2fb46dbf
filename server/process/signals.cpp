#include "server/process/signals.h"

#include <spdlog/spdlog.h>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <csignal>
#include <cstdlib>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/process/log.h"

namespace taclink::server {

Signals::Signals() : stop_signals_(context_, SIGINT, SIGTERM), reload_signals_(context_, SIGHUP) {
  AwaitStop();
  thread_ = MustStartThread("signals", [this] { context_.run(); });
}

Signals::~Signals() {
  context_.stop();
}

void Signals::OnReload(std::function<void()> reload) {
  boost::asio::post(context_, [this, reload = std::move(reload)]() mutable {
    const bool first = !reload_;
    reload_ = std::move(reload);
    if (first) AwaitReload();
  });
}

std::string Signals::WaitForStop() {
  return stopped_.get_future().get();
}

void Signals::AwaitStop() {
  stop_signals_.async_wait([this](const boost::system::error_code& error, int number) {
    if (error) return;
    const char* const name = number == SIGTERM ? "SIGTERM" : "SIGINT";
    if (stopping_) {
      SPDLOG_WARN("{} again: ending at once", name);
      EndLog();
      std::_Exit(1);
    }
    stopping_ = true;
    stopped_.set_value(name);
    AwaitStop();
  });
}

void Signals::AwaitReload() {
  reload_signals_.async_wait([this](const boost::system::error_code& error, int) {
    if (error) return;
    if (!stopping_) reload_();
    AwaitReload();
  });
}

}  // namespace taclink::server
