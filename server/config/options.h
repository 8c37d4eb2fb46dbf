#pragma once

#include <sched.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mcap/compression.h"
#include "sensing/core/address.h"
#include "sensing/core/name.h"
#include "sensing/core/result.h"
#include "sensing/yaml/fields.h"
#include "wire/detail.h"

// Sections of the configuration file; the line of a key in Describe gives meaning and range of its member.

namespace taclink::server {

/// What clients may cost. What goes beyond is refused or dropped, and the client learns which limit it was.
struct LimitsConfig {
  int max_links = 32, max_connections = 256, max_connections_per_peer = 64;
  int max_streams = 64, max_streams_per_peer = 16, max_calls_per_connection = 100;
  int max_message_kb = 64, memory_mb = 256, queue_messages = 256, queue_mb = 32, queue_mb_per_peer = 64;
  int keepalive_s = 60, keepalive_timeout_s = 120, handshake_timeout_s = 20, idle_timeout_s = 300;
  std::chrono::milliseconds max_frame_age{0};  ///< 0: by the frame rate
  void Describe(FieldVisitor& visit) {
    constexpr Range kCount{1, 10000}, kMegabytes{1, 65536}, kDay{1, 86400};
    visit("max_links", max_links, kCount, "Links of the arm; each takes some 100 MB.");
    visit("max_connections", max_connections, {16, 10000},
          "Connections of gRPC; a quarter is for this machine.");
    visit("max_connections_per_peer", max_connections_per_peer, kCount,
          "Connections of one other address; then the oldest without a good call gives way.");
    visit("max_streams", max_streams, kCount,
          "Streams; a quarter is for callers on this machine or with a token or certificate.");
    visit("max_streams_per_peer", max_streams_per_peer, kCount, "Streams of one caller or address.");
    visit("max_calls_per_connection", max_calls_per_connection, kCount, "Concurrent calls.");
    visit("max_message_kb", max_message_kb, {1, 65536}, "Size of a request.");
    visit("memory_mb", memory_mb, {16, 65536}, "Memory of gRPC: connections, requests, replies.");
    visit("queue_messages", queue_messages, {1, 100000}, "Frames queued for a stream with `every`.");
    visit("queue_mb", queue_mb, kMegabytes, "Memory of the frames queued for a stream.");
    visit("queue_mb_per_peer", queue_mb_per_peer, kMegabytes, "Likewise for all streams of a peer.");
    visit("keepalive_s", keepalive_s, kDay, "Interval of pings on a connection without traffic.");
    visit("keepalive_timeout_s", keepalive_timeout_s, kDay, "Longest wait for the answer to a ping.");
    visit("handshake_timeout_s", handshake_timeout_s, {1, 3600}, "Longest wait for gRPC to begin.");
    visit("idle_timeout_s", idle_timeout_s, kDay, "A connection is closed so long after its last call.");
    visit("max_frame_age_s", max_frame_age, {0, 86400},
          "Older when published, frames are degraded; 0: three frame periods, at least 0.2 s.");
  }
};

/// Limits that the watchdog holds workers to, and what it does about those that break them.
struct WatchdogOptions {
  using Time = std::chrono::milliseconds;
  Time interval{100};  ///< between two checks
  Time source_start{5000}, source_next{1000}, first_frames{20000}, frame{1000};
  Time other{1000};  ///< longest stay in another stage: publishing, and waiting beyond the poll
  Time abandon{30000}, build{120000}, proven{60000};
  int deaths = 3;
  Time first_backoff{500}, longest_backoff{10000};
  Time heartbeat{1000};  ///< of the status, while the watchdog publishes it
  Time stop{3000};       ///< at shutdown, before a thread is given up; real time
  void Describe(FieldVisitor& visit) {
    constexpr Range kSeconds{0.01, 86400};
    visit("source_start_s", source_start, kSeconds, "Longest start of a source before it is reported.");
    visit("source_next_s", source_next, kSeconds, "Longest wait for images beyond the source's timeout.");
    visit("first_frames_s", first_frames, kSeconds, "Longest frame while the link calibrates.");
    visit("frame_s", frame, kSeconds, "Longest processing of a frame.");
    visit("abandon_s", abandon, kSeconds, "A thread is replaced after so long in one stage.");
    visit("build_s", build, kSeconds, "Longest construction of a new source and processor.");
    visit("proven_s", proven, kSeconds, "A worker that ran so long resets the count of failures.");
    visit("deaths", deaths, {1, 1000}, "Failures in a row that suspend the restart of the link.");
    visit.Check(abandon >= std::max({source_start, source_next, frame}), "abandon_s",
                "must not be shorter than a stage may take: source_start_s, source_next_s, frame_s",
                {"source_start_s", "source_next_s", "frame_s"});
  }
};

struct ShutdownConfig {
  std::chrono::milliseconds limit{2000};
  void Describe(FieldVisitor& visit) { visit("limit_s", limit, {0, 600}, "Time for clients to leave."); }
};

struct LogRates {
  int per_site = 10, total = 600;
};
enum class LogFormat { kText, kJson };

struct LogOptions {
  std::string level = "info";
  LogFormat format = LogFormat::kText;
  std::string file = {};
  LogRates rates = {};
  void Describe(FieldVisitor& visit) {
    constexpr Range kRates{0, 1'000'000};
    visit.Choice("level", level, {"debug", "info", "warning", "error"}, "Least severe level that is logged.");
    visit.Choice("format", format, {"text", "json"}, "Text, or one JSON object a line.");
    visit("file", file, "Absolute path of the file to append to; empty: standard error.");
    visit.Check(file.empty() || file.starts_with('/'), "file", "must be an absolute path");
    visit("rate_limit", rates.per_site, kRates, "Messages a minute of a place and source; 0: no limit.");
    visit("rate_limit_total", rates.total, kRates, "In total; a quarter for warnings; 0: no limit.");
  }
};

/// How a link's threads run.
struct RealtimeOptions {
  int priority = 0;
  std::vector<int> cpus = {};
  void Describe(FieldVisitor& visit) {
    visit("priority", priority, {0, 99}, "Priority of SCHED_FIFO; 0: as any thread.");
    visit("cpus", cpus, {0, CPU_SETSIZE - 1}, "Processors that may run the threads, from 0; empty: all.");
    std::ranges::sort(cpus);
    cpus.erase(std::unique(cpus.begin(), cpus.end()), cpus.end());
  }
};

inline constexpr const char* kDefaultHttpListen = "127.0.0.1:8080";
/// The HTTP gateway: web page, gRPC-Web, metrics, health.
struct HttpConfig {
  std::optional<std::string> listen;
  std::string web_root;
  int max_connections = 128, max_connections_per_peer = 32;
  double header_timeout_s = 10, idle_timeout_s = 60, write_timeout_s = 120;
  void Describe(FieldVisitor& visit) {
    constexpr Range kConnections{1, 10000}, kTimeouts{0.01, 3600};
    visit("listen", listen, "Empty: off; not set: 127.0.0.1:8080 if it is free.", CheckHttpListen);
    visit.Path("web_root", web_root, "Folder of the web page; empty: the built-in one.");
    visit("max_connections", max_connections, kConnections, "Connections; a quarter is for this machine.");
    visit("max_connections_per_peer", max_connections_per_peer, kConnections, "Connections of one address.");
    visit("header_timeout_s", header_timeout_s, kTimeouts, "Longest wait for a request and its headers.");
    visit("idle_timeout_s", idle_timeout_s, kTimeouts, "Longest time between two requests.");
    visit("write_timeout_s", write_timeout_s, kTimeouts, "Longest time in which a client reads nothing.");
  }
};

/// Files that guard the server; empty: none. They are read again when they change.
struct SecurityConfig {
  std::string certificate, key, client_ca, tokens;
  bool tokens_keep = false, tokens_open = false;
  int max_failed_tries = 20;
  void Describe(FieldVisitor& visit) {
    visit.Path("certificate", certificate, "PEM, the server's own first: TLS for gRPC and HTTP.");
    visit.Path("key", key, "PEM, of the certificate.");
    visit.Path("client_ca", client_ca, "PEM: clients must show a certificate signed by one of these.");
    visit.Path("tokens", tokens, "Access tokens; without them everyone is an operator.");
    visit.Check(certificate.empty() == key.empty(), key.empty() ? "certificate" : "key",
                "is of no use alone: 'certificate' and 'key' need each other", {"certificate", "key"});
    visit.Check(client_ca.empty() || !certificate.empty(), "client_ca",
                "needs 'certificate' and 'key': it is asked for within TLS", {"certificate"});
    visit.Choice("tokens_on_error", tokens_keep, {"refuse", "keep"}, "Effect of an invalid file.");
    visit.Choice("tokens_permissions", tokens_open, {"strict", "any"}, "Its permissions.");
    visit("max_failed_tries_per_minute", max_failed_tries, {0, 1'000'000}, "Of one address; 0: no limit.");
  }
};

struct JointStateOptions {
  std::chrono::milliseconds extrapolate{50}, stale_after{200};
  size_t capacity = 2048;  ///< states kept of each joint
  void Describe(FieldVisitor& visit) {
    visit("stale_after_s", stale_after, {0.001, 60}, "A position is stale farther than this from any state.");
    extrapolate = std::min(extrapolate, stale_after);  // unless the file says it
    visit("extrapolate_s", extrapolate, {0, 60}, "Longest extrapolation beyond the newest state.");
    visit.Check(extrapolate <= stale_after, "extrapolate_s", "must not be above stale_after_s",
                {"stale_after_s"});
  }
};

/// What `arm` says of its joints.
struct KinematicsConfig {
  std::optional<std::string> urdf;
  std::string base;
  std::array<double, 3> gravity_mps2{0, 0, -9.80665};  ///< base frame
  JointStateOptions joint_states;
  void Describe(FieldVisitor& visit) {
    visit.Path("urdf", urdf, "Description of the arm's joints; not set: the links stand still.");
    visit("base", base, "Link of the URDF that the arm's frame is; empty: its root.");
    visit.Check(base.empty() || urdf, "base", "is a link of a URDF; give 'urdf' too", {"urdf"});
    visit("gravity_mps2", gravity_mps2, {-100, 100}, "Where things fall, in the base's frame.");
    if (!visit.Wants("joint_states", urdf.has_value())) return;
    visit("joint_states", joint_states, "How joint states become positions at an image's exposure.");
    visit.Check(urdf.has_value(), "joint_states", "are of a URDF's joints; give 'urdf' too", {"urdf"});
  }
};

enum class ForceLevel : uint8_t { kNormal, kWarning, kAlarm };

struct Thresholds;
/// Errors: kInvalidArgument (not 0 <= hysteresis < warning <= alarm, absurd).
Result<void> CheckThresholds(const Thresholds& thresholds);

/// Of the strongest contact's magnitude (Contact::magnitude_n). A level is entered at its threshold and left
/// below it by `hysteresis_n`.
struct Thresholds {
  double warning_n = 0, alarm_n = 0, hysteresis_n = 0.05;
  void Describe(FieldVisitor& visit) {
    constexpr Range kForce{0, 10'000};
    visit("warning_n", warning_n, kForce, "The level is `warning` from this force; 0: no such level.");
    visit("alarm_n", alarm_n, kForce, "The level is `alarm` from this force; 0: no such level.");
    visit("hysteresis_n", hysteresis_n, kForce, "A level is left this far below its threshold.");
    if (const auto good = CheckThresholds(*this); !good)
      visit.Fail("hysteresis_n", "is not valid: " + good.error().message, {"warning_n", "alarm_n"});
  }
};

/// A part of the marker grid; rings and paths from 0, inclusive. Paths go round: first > last crosses path 0.
struct Region {
  std::string name;
  int first_ring = 0, last_ring = 0, first_path = 0, last_path = 0;
  Thresholds thresholds = {};
  bool Holds(int path, int ring) const {
    const bool in_paths = first_path <= last_path ? path >= first_path && path <= last_path
                                                  : path >= first_path || path <= last_path;
    return in_paths && ring >= first_ring && ring <= last_ring;
  }
  void Describe(FieldVisitor& visit) {
    constexpr Range kGrid{1, 10'000};
    std::array rings{first_ring + 1, last_ring + 1}, paths{first_path + 1, last_path + 1};
    visit(Required("name"), name, "Unique on the link.", CheckName);
    visit(Required("rings"), rings, kGrid, "First and last ring of markers, from 1.");
    visit(Required("paths"), paths, kGrid, "First and last path of markers, from 1; may cross path 1.");
    first_ring = rings[0] - 1, last_ring = rings[1] - 1;
    first_path = paths[0] - 1, last_path = paths[1] - 1;
    thresholds.Describe(visit);
  }
};

struct LinkRules {
  Thresholds thresholds;
  std::vector<Region> regions;
};

struct EventOptions {
  int history = 10'000;
  double begin_n = 0.05, end_n = 0.03, release_s = 0.15, update_rate_hz = 5, drift_step_mm = 0.1;
  std::string audit;  ///< file; empty: none
  int audit_max_kb = 1024;
  void Describe(FieldVisitor& visit) {
    visit("history", history, {1, 1'000'000}, "Events kept for clients that reconnect.");
    visit("begin_n", begin_n, {0.001, 1000}, "A contact begins at this force.");
    visit("end_n", end_n, {0.001, 1000}, "A contact ends below this force.");
    visit.Check(end_n <= begin_n, "end_n", "must not be above begin_n", {"begin_n"});
    visit("release_s", release_s, {0, 60}, "A contact ends after this time below end_n.");
    visit("update_rate_hz", update_rate_hz, {0.001, 1000}, "Most updates of each contact.");
    visit("drift_step_mm", drift_step_mm, {0.001, 100}, "Steps in which a baseline's drift is reported.");
    visit.Path("audit", audit, "File of the audit trail; empty: none.");
    visit("audit_max_kb", audit_max_kb, {1, 1'000'000}, "Size at which it is renamed to FILE.1.");
  }
};

struct RecordingConfig {
  std::string folder = {};  ///< of the recordings; empty: nothing can be recorded
  bool at_start = false, pictures = false;
  mcap::Compression compression = mcap::Compression::kZstd, picture_compression = mcap::Compression::kNone;
  double split_mb = 1024, split_s = 3600, quota_mb = 0, sync_s = 1, queue_mb = 256, scene_rate_hz = 10;
  void Describe(FieldVisitor& visit) {
    constexpr Range kSplit{0, 1e6};
    const Names compressions = {"none", "zstd", "lz4"};
    visit.Path(NoDefault("folder"), folder, "Empty: none; not set: ~/.local/state/taclink/logs.");
    visit("at_start", at_start, "Begin a recording with the server.");
    visit.Check(!at_start || !folder.empty(), "at_start", "needs a folder", {"folder"});
    visit("pictures", pictures, "Record the cameras' images as well.");
    visit.Choice("compression", compression, compressions, "Compression without images.");
    visit.Choice("picture_compression", picture_compression, compressions, "Compression with images.");
    visit("split_mb", split_mb, kSplit, "A file of this size is closed, and the next one begun; 0: never.");
    visit("split_s", split_s, kSplit, "A file of this age is closed, and the next one begun; 0: never.");
    visit("quota_mb", quota_mb, {0, 1e9}, "Size of the folder: the oldest files are deleted; 0: no limit.");
    visit("sync_s", sync_s, {0.05, 60}, "Interval of flushing; a power failure loses no more.");
    visit("queue_mb", queue_mb, {1, 65536}, "Memory for data that waits for a slow disk.");
    visit("scene_rate_hz", scene_rate_hz, {0, 1000}, "Rate of each link's scene for Foxglove; 0: none.");
  }
};

/// Where acceptances of the links are kept.
struct AcceptanceConfig {
  std::string folder = {};  ///< empty: links cannot be accepted
  void Describe(FieldVisitor& visit) {
    visit.Path(NoDefault("folder"), folder, "Empty: none; not set: ~/.local/state/taclink/acceptance.");
  }
};

/// What goes to a NATS server with JetStream.
struct PublishConfig {
  std::string url = {};  ///< empty: nothing is sent
  std::string site = "site", stream = {};
  double stream_mb = 1024;
  std::string tls_ca = {}, certificate = {}, key = {}, credentials = {}, token_file = {};
  Detail frames_detail = Detail::kGeometry;
  double frames_rate_hz = 10, contacts_deadband_n = 0.02, queue_mb = 64;
  void Describe(FieldVisitor& visit) {
    visit(Required("url"), url, "nats:// or tls://, several with commas; empty: off.", CheckNatsUrls);
    visit("site", site, "Second part of the subjects.", CheckSubjectPart);
    if (stream.empty()) stream = "TACLINK_" + site;
    visit(NoDefault("stream"), stream, "Not set: TACLINK_ and the site.", CheckSubjectPart);
    visit("stream_mb", stream_mb, {1, 1e9}, "Size of the stream: the oldest messages are dropped.");
    visit.Path("tls_ca", tls_ca, "PEM; empty: the authorities that this machine trusts.");
    visit.Path("certificate", certificate, "PEM, this server's own.");
    visit.Path("key", key, "PEM, of the certificate.");
    visit.Check(certificate.empty() == key.empty(), "key", "needs its certificate", {"certificate"});
    visit.Path("credentials", credentials, "File of the NATS user's credentials (.creds).");
    visit.Path("token_file", token_file, "File of the NATS token.");
    visit.Choice("frames_detail", frames_detail, {"contacts", "geometry", "full"}, "Detail of frames.");
    visit("frames_rate_hz", frames_rate_hz, {0, 1000}, "Frames of each link; 0: none.");
    visit("contacts_deadband_n", contacts_deadband_n, {0, 1000}, "Smaller changes are sent once a second.");
    visit("queue_mb", queue_mb, {1, 65536}, "Memory for data while no server is reachable.");
  }
};

}  // namespace taclink::server
