#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "sensing/yaml/yaml_reader.h"
#include "wire/detail.h"

namespace taclink::server {

/// The section `publish` of the configuration: what goes to a NATS server with JetStream.
struct PublishConfig {
  std::string url = {};       ///< nats:// or tls://host:port, several with commas; empty: nothing is sent
  std::string site = "site";  ///< second part of the subjects
  std::string stream = {};    ///< made if it is not there; empty: TACLINK_ and the site
  double stream_mb = 1024;    ///< of a stream that is made: the oldest give way
  std::string tls_ca = {};    ///< PEM; empty: those that this machine trusts
  std::string certificate = {}, key = {};  ///< PEM, this server's own
  std::string credentials = {};            ///< file of NATS' user credentials (.creds)
  std::string token_file = {};
  Detail frames_detail = Detail::kGeometry;
  double frames_rate_hz = 10;         ///< of each link; 0: no frames
  double contacts_deadband_n = 0.02;  ///< changes of contacts below it are told once a second
  double queue_mb = 64;               ///< that waits while there is no server, in memory
};

/// PublishConfig::url in its parts.
std::vector<std::string> SplitUrls(const std::string& urls);

/// A mapping, or the URL alone. `path` makes a path of the file usable.
PublishConfig ReadPublish(YamlMap& root, const std::function<std::string(const std::string&)>& path);
void WritePublish(std::ostream& out, const PublishConfig& config);

}  // namespace taclink::server
