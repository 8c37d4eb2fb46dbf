#pragma once

#include <string>

#include "sensing/yaml/yaml_reader.h"

namespace taclink::server {

/// What clients may cost, section `limits`. What goes beyond is refused or dropped, and the client is told by
/// which of these.
struct LimitsConfig {
  int max_links = 32;             ///< of the arm; each takes some 100 MB
  int max_streams = 64;           ///< of all clients together; a quarter is kept for preferred ones (Party)
  int max_streams_per_peer = 16;  ///< of one caller or address; on this machine, of one connection
  /// Calls under way on one connection, streams included; a client's library lets further ones wait.
  int max_calls_per_connection = 100;
  int max_message_kb = 64;        ///< a request's size
  int memory_mb = 256;            ///< that gRPC may use for connections, requests and what is being sent
  int queue_messages = 256;       ///< frames that can wait for one stream with `every`
  int queue_mb = 32;              ///< memory that they keep
  int queue_mb_per_peer = 64;     ///< memory that the frames for all streams of one peer keep
  int keepalive_s = 60;           ///< a connection without traffic is asked for a sign of life so often
  int keepalive_timeout_s = 120;  ///< and closed without an answer for so long
  int handshake_timeout_s = 20;   ///< a connection that has not spoken gRPC by then is closed
  int idle_timeout_s = 300;  ///< so is one without a call for so long; clients connect again by themselves
};

/// `root`: the whole file's.
LimitsConfig ReadLimits(YamlMap& root);
std::string LimitsText(const LimitsConfig& limits);

}  // namespace taclink::server
