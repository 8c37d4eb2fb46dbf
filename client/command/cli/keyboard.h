#pragma once

#include <termios.h>

#include <optional>

namespace taclink::command {

/// Keys as they are pressed, while it lives; without a terminal there are none. Ctrl-C stays a signal.
class Keyboard {
 public:
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  bool is_there() const { return before_.has_value(); }
  /// The next key that was pressed; none: no further one yet.
  std::optional<char> Next();

 private:
  std::optional<termios> before_;
};

}  // namespace taclink::command
