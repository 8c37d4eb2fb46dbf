#include "client/command/live/watch_keys.h"

#include <fmt/format.h>

#include "client/cpp/taclink/recordings.h"

namespace taclink::command {

void WatchKeys::Run() {
  while (const auto key = keyboard_.Next()) Press(*key);
}

std::string WatchKeys::Help() const {
  if (!keyboard_.is_there()) return {};
  return paused_ ? "p goes on   r record   t tare   q end" : "p pause   r record   t tare   q end";
}

void WatchKeys::Press(char key) {
  const bool confirmed = confirms_tare_ && key == 'y';
  if (confirms_tare_ && !confirmed) message_ = "not tared";
  confirms_tare_ = false;
  if (confirmed) return Tare();
  switch (key) {
    case 'p':
      paused_ = !paused_;
      break;
    case 'q':
      ends_ = true;
      break;
    case 'r':
      ToggleRecording();
      break;
    case 't':
      confirms_tare_ = true;
      message_ = "take what all links show now as untouched? y: yes, any other key: no";
      break;
    default:
      break;
  }
}

void WatchKeys::ToggleRecording() {
  client::Recordings recordings = connection_.RecordingCalls();
  const auto status = recordings.Status();
  const bool is_idle = status && (status->state() == v1::RECORDER_STATE_IDLE);
  const auto changed = !status ? status : is_idle ? recordings.Start({}) : recordings.Stop();
  message_ = !changed  ? changed.error().message
             : is_idle ? "records into " + changed->log()
                       : fmt::format("recording ended: {}, {} frames", changed->log(), changed->frames());
}

void WatchKeys::Tare() {
  const auto response = connection_.Tare({});
  if (!response) {
    message_ = response.error().message;
    return;
  }
  message_ = "tared";
  for (const v1::LinkTare& link : response->links()) {
    if (link.accepted()) continue;
    message_ = link.link() + " refused: " + link.reason();
  }
}

}  // namespace taclink::command
