#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>

#include "sensing/core/result.h"
#include "server/listener/token_bucket.h"
#include "server/security/party.h"

namespace taclink::server {

struct ConnectionLimits {
  size_t all = 256;       ///< a quarter of them is kept for this machine
  size_t per_place = 64;  ///< of one address; this machine may have three quarters of all
};

/// The connections of a listener: how many each address may have, which one gives way to a new one, and how
/// fast new ones are taken. Tokens come later, with the calls: until then a connection is *unauthorized*, and
/// the oldest of these gives way, so that idle unauthorized connections cannot exhaust the limits. Times are
/// monotonic. Guarded by its owner.
class ConnectionTable {
 public:
  using Id = uint64_t;

  explicit ConnectionTable(const ConnectionLimits& limits) : limits_(limits) {}

  struct Admission {
    Id id = 0;
    std::optional<Id> gives_way;  ///< to be ended; does not count any more
  };
  /// A new connection from `peer` ("ipv4:192.168.1.5:40000"). Errors: kResourceExhausted (all are authorized,
  /// or too many of the address wait).
  Result<Admission> Admit(const std::string& peer);
  void Remove(Id id);
  /// The oldest unauthorized connection, which does not count from now on: descriptors have run out. None:
  /// there is none.
  std::optional<Id> GiveWay();
  /// The connection from `peer`. None: there is none, or it is one of a unix socket, which all have the same
  /// peer.
  std::optional<Id> Find(const std::string& peer) const;
  /// An authorized call came over the connection from `peer`. None: as of Find, or it was authorized before.
  /// Connections of a unix socket are authorized from the start.
  std::optional<Id> MarkAuthorized(const std::string& peer);

  struct Turn {
    int64_t wait_ns = 0;          ///< > 0: the connection waits; ask again then
    std::optional<Id> gives_way;  ///< as of an admission
  };
  /// Whether gRPC may have the connection now, by the pace of its address. While it waits it costs gRPC
  /// nothing, and no other one makes it give way.
  Turn TakeTurn(Id id, int64_t now_ns);
  /// The connection did what it must not: its address has to wait for some time.
  void Punish(Id id, int64_t now_ns);

  size_t size() const { return connections_.size(); }
  size_t addresses() const { return paces_.size(); }  ///< whose pace is remembered

 private:
  struct Connection {
    Place place;
    std::string key;      // of the peer
    bool waiting = true;  // not handed over yet
    bool authorized = false;
    bool leaving = false;  // does not count
  };
  /// New connections of one address.
  struct Pace {
    TokenBucket bucket;
    int64_t punished_until_ns = 0;
  };
  template <typename F>
  size_t Count(const F& among) const;
  template <typename F>
  std::optional<Id> OldestUnauthorized(const F& among);
  Pace& PaceOf(const Place& place, int64_t now_ns);

  const ConnectionLimits limits_;
  std::map<Id, Connection> connections_;            // the oldest first
  std::unordered_map<std::string, Id> id_of_peer_;  // by key; not those of unix sockets
  std::map<std::string, Pace> paces_;               // by address
  int64_t next_sweep_ns_ = 0;                       // of paces_
  Id last_ = 0;
};

}  // namespace taclink::server
