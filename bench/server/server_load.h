#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/cpp/taclink/client.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// One way to load a server.
struct ServerLoad {
  int links = 1;
  double rate_hz = 30;
  int clients = 1;
  v1::Detail detail = v1::DETAIL_FULL;
};

/// What came of it, over `seconds`.
struct LoadResult {
  ServerLoad load;
  double seconds = 0;
  uint64_t received = 0;  ///< frames, of all clients
  uint64_t skipped = 0;   ///< exposures that the server did not solve, of all links
  uint64_t dropped = 0;   ///< frames that the server solved but a client did not get, of all clients
  double exposure_p50_ms = 0, exposure_p99_ms = 0;  ///< exposure to client
  double memory_p50_ms = 0, memory_p99_ms = 0;      ///< both pictures in the server's memory to client
  double stages_p99_ms = 0;                         ///< of a frame's own computation, as the server tells it
  double beside_p99_ms = 0;  ///< memory to client without it: waiting, sending, receiving
  double server_cores = 0;   ///< CPU time of the server per time
  double clients_cores = 0;  ///< of all clients together, in this process
  double other_cores = 0;    ///< of everything else on the machine
  double server_mb = 0;      ///< resident at the end, without the pictures
};

/// A folder with pictures for `links`, rendered once: a touch that comes and goes.
struct LoadPictures {
  std::string folder;
  int pairs = 0;
  double megabytes = 0;  ///< in a server's memory, for each link
};
Result<LoadPictures> RenderLoadPictures(const std::string& folder);

/// A server's configuration for some links that play them at a rate, as gray or as YUYV pictures.
std::string LoadConfigText(const LoadPictures& pictures, int links, double rate_hz, bool yuyv = false);

/// Until every link has its baseline. Errors: kTimeout, with what a link says.
Result<void> WaitUntilMeasuring(client::Client& connection);
/// Exposures that the server did not solve, of all links.
Result<uint64_t> FramesSkipped(client::Client& connection);

/// Starts one server for loads of the same links and rate, and its clients one load after another.
/// `seconds`: of each measurement. `more`: lines of the server's configuration.
Result<std::vector<LoadResult>> MeasureLoads(const std::vector<ServerLoad>& loads,
                                             const LoadPictures& pictures, const std::string& taclinkd,
                                             double seconds, const std::string& more = "");

}  // namespace taclink::command
