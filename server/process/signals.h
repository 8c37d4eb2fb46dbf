#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <functional>
#include <future>
#include <string>
#include <thread>

namespace taclink::server {

/// Takes the process's signals, in a thread of its own, from construction on.
class Signals {
 public:
  Signals();
  ~Signals();

  /// What SIGHUP does from now on; before, it is kept back.
  void OnReload(std::function<void()> reload);
  /// SIGTERM's or SIGINT's name. After the first a second one ends the program at once, with status 1.
  std::string WaitForStop();

 private:
  void AwaitStop();
  void AwaitReload();

  boost::asio::io_context context_;
  boost::asio::signal_set stop_signals_, reload_signals_;
  std::promise<std::string> stopped_;
  bool stopping_ = false;         // used by the thread only
  std::function<void()> reload_;  // used by the thread only
  std::jthread thread_;
};

}  // namespace taclink::server
