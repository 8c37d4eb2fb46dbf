#pragma once

#include <chrono>

namespace taclink::server {

/// Limits that the watchdog holds workers to, and what it does about those that break them.
struct WatchdogOptions {
  std::chrono::milliseconds interval{100};  ///< between two looks
  // Longest stay in a stage before it is reported.
  std::chrono::milliseconds source_start{5000};
  std::chrono::milliseconds source_next{1000};    ///< beyond the time that the source was given
  std::chrono::milliseconds first_frames{20000};  ///< a frame, while the link calibrates
  std::chrono::milliseconds frame{1000};
  std::chrono::milliseconds other{1000};     ///< publishing, and waiting beyond the poll
  std::chrono::milliseconds abandon{30000};  ///< a thread that stays longer in one stage is given up
  std::chrono::milliseconds build{120000};   ///< longest making of a fresh source and processor
  int deaths = 3;                            ///< so many in a row and the link rests
  std::chrono::milliseconds proven{60000};   ///< a worker that lived so long begins a new row
  std::chrono::milliseconds first_backoff{500};
  std::chrono::milliseconds longest_backoff{10000};
  std::chrono::milliseconds heartbeat{1000};  ///< of the status, while the watchdog publishes it
  std::chrono::milliseconds stop{3000};       ///< at shutdown, before a thread is given up; real time
};

}  // namespace taclink::server
