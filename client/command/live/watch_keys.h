#pragma once

#include <string>

#include "client/command/cli/keyboard.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// The keys of `taclink watch` on a terminal: p pauses the screen, r begins and ends a recording, t tares all
/// links once it is confirmed, q ends.
class WatchKeys {
 public:
  explicit WatchKeys(client::Client& connection) : connection_(connection) {}

  /// Does what the keys say that were pressed since the last call.
  void Run();

  bool paused() const { return paused_; }
  bool ends() const { return ends_; }
  /// What came of the last key, or what is asked; for people. Empty: nothing.
  const std::string& message() const { return message_; }
  /// One line that lists the keys; empty: input is not a terminal.
  std::string Help() const;

 private:
  void Press(char key);
  void ToggleRecording();
  void Tare();

  client::Client& connection_;
  Keyboard keyboard_;
  bool paused_ = false, ends_ = false;
  bool confirms_tare_ = false;
  std::string message_;
};

}  // namespace taclink::command
