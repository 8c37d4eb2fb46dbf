#include "server/listener/connection_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "server/security/shares.h"

namespace taclink::server {
namespace {

constexpr double kLocalBurst = 4096, kLocalPerS = 4096;  // no limit for programs and scripts on this machine
constexpr double kRemoteBurst = 128, kRemotePerS = 40;
constexpr double kPunishedBurst = 1, kPunishedPerS = 100;
constexpr int64_t kPunishmentNs = 10'000'000'000;
constexpr int64_t kSweepIntervalNs = 1'000'000'000;
constexpr size_t kMostPaces = 1024;
constexpr size_t kUnauthorizedShare = 10,
                 kLeastUnauthorized = 4;  // of all connections, for one address; twice for all
constexpr size_t kMostWaiting = 64;       // of one address

// One text for one connection, whether gRPC writes its peer (IPv6 in brackets as %5B and %5D, with the scope)
// or the listener does.
std::string KeyOf(const std::string& peer) {
  const size_t port = std::min(peer.rfind(':'), peer.size());
  std::string host = peer.substr(0, port);
  for (const std::string_view bracket : {"[", "%5B", "%5b"}) {
    if (const size_t at = host.find(bracket); at != std::string::npos) host.erase(at, bracket.size());
  }
  host.erase(std::min(host.find_first_of("]%"), host.size()));
  return host + peer.substr(port);
}

// All addresses of this machine are one place.
std::string NameOf(const Place& place) {
  return place.local ? "this machine" : place.address;
}

}  // namespace

template <typename F>
size_t ConnectionTable::Count(const F& among) const {
  return static_cast<size_t>(std::count_if(connections_.begin(), connections_.end(), [&](const auto& each) {
    return !each.second.leaving && among(each.second);
  }));
}

template <typename F>
std::optional<ConnectionTable::Id> ConnectionTable::OldestUnauthorized(const F& among) {
  for (auto& [id, connection] : connections_) {
    if (connection.authorized || connection.leaving || !among(connection)) continue;
    connection.leaving = true;
    return id;
  }
  return std::nullopt;
}

Result<ConnectionTable::Admission> ConnectionTable::Admit(const std::string& peer) {
  const Place place = PlaceOf(peer);
  const size_t kept = Kept(limits_.all);
  const size_t most_here = place.local ? limits_.all - kept : limits_.per_place;
  const auto same = [name = NameOf(place)](const Connection& other) { return NameOf(other.place) == name; };
  const auto remote = [](const Connection& other) { return !other.place.local; };
  const auto any = [](const Connection&) { return true; };
  const auto oldest = [this](const auto& among) {
    return OldestUnauthorized([&](const Connection& other) { return !other.waiting && among(other); });
  };
  if (Count([&](const Connection& other) { return other.waiting && same(other); }) >= kMostWaiting)
    return Error{ErrorCode::kResourceExhausted,
                 fmt::format("connections of {} come faster than they are taken", NameOf(place))};
  Admission admission;
  std::string taken;
  if (Count(same) >= most_here) {
    taken = fmt::format("all {} connections of {}", most_here, NameOf(place));
    admission.gives_way = oldest(same);
  } else if (!place.local && Count(remote) >= limits_.all - kept) {
    taken = fmt::format("all {} connections but those kept for this machine", limits_.all - kept);
    admission.gives_way = oldest(remote);
  } else if (Count(any) >= limits_.all) {
    taken = fmt::format("all {} connections", limits_.all);
    admission.gives_way = oldest(any);
  }
  if (!taken.empty() && !admission.gives_way)
    return Error{ErrorCode::kResourceExhausted,
                 taken +
                     " are in use; close one or raise limits.max_connections or "
                     "limits.max_connections_per_peer"};
  admission.id = ++last_;
  // gRPC gives all connections of a unix socket the same peer; the permissions of its file say who may
  // connect.
  const bool is_unix = peer.starts_with("unix");
  const auto at = connections_.emplace(admission.id,
                                       Connection{.place = place, .key = KeyOf(peer), .authorized = is_unix});
  if (!is_unix) id_of_peer_[at.first->second.key] = admission.id;
  return admission;
}

void ConnectionTable::Remove(Id id) {
  const auto at = connections_.find(id);
  if (at == connections_.end()) return;
  const auto named = id_of_peer_.find(at->second.key);
  if (named != id_of_peer_.end() && named->second == id) id_of_peer_.erase(named);
  connections_.erase(at);
}

std::optional<ConnectionTable::Id> ConnectionTable::GiveWay() {
  return OldestUnauthorized([](const Connection&) { return true; });
}

std::optional<ConnectionTable::Id> ConnectionTable::Find(const std::string& peer) const {
  const auto named = id_of_peer_.find(KeyOf(peer));
  return named == id_of_peer_.end() ? std::nullopt : std::optional(named->second);
}

std::optional<ConnectionTable::Id> ConnectionTable::MarkAuthorized(const std::string& peer) {
  const auto id = Find(peer);
  if (!id || std::exchange(connections_.at(*id).authorized, true)) return std::nullopt;
  return id;
}

ConnectionTable::Pace& ConnectionTable::PaceOf(const Place& place, int64_t now_ns) {
  // Addresses that have long been silent are as new ones; where there are too many all the same, they share
  // one pace.
  if (paces_.size() >= kMostPaces && now_ns >= next_sweep_ns_) {
    next_sweep_ns_ = now_ns + kSweepIntervalNs;
    std::erase_if(paces_, [&](const auto& pace) {
      return pace.second.punished_until_ns <= now_ns && pace.second.bucket.IsFull(now_ns);
    });
  }
  std::string name = NameOf(place);
  if (paces_.size() >= kMostPaces && !paces_.contains(name)) name = "others";
  const TokenBucket fresh =
      place.local ? TokenBucket(kLocalBurst, kLocalPerS) : TokenBucket(kRemoteBurst, kRemotePerS);
  Pace& pace = paces_.try_emplace(name, Pace{.bucket = fresh}).first->second;
  if (pace.punished_until_ns != 0 && pace.punished_until_ns <= now_ns) pace = {.bucket = fresh};
  return pace;
}

ConnectionTable::Turn ConnectionTable::TakeTurn(Id id, int64_t now_ns) {
  const auto at = connections_.find(id);
  if (at == connections_.end()) return {};
  Pace& pace = PaceOf(at->second.place, now_ns);
  if (!pace.bucket.Take(now_ns)) return {.wait_ns = pace.bucket.WaitNs(now_ns), .gives_way = {}};
  // The memory that connections without an authorized call can take is bounded by their number.
  const size_t most = std::max(limits_.all / kUnauthorizedShare, kLeastUnauthorized);
  const auto any = [](const Connection& other) { return !other.waiting && !other.authorized; };
  const auto same = [&, name = NameOf(at->second.place)](const Connection& other) {
    return any(other) && NameOf(other.place) == name;
  };
  Turn turn;
  if (Count(same) >= most) {
    turn.gives_way = OldestUnauthorized(same);
  } else if (Count(any) >= 2 * most) {
    turn.gives_way = OldestUnauthorized(any);
  }
  at->second.waiting = false;
  return turn;
}

void ConnectionTable::Punish(Id id, int64_t now_ns) {
  const auto at = connections_.find(id);
  if (at == connections_.end()) return;
  Pace& pace = PaceOf(at->second.place, now_ns);
  if (pace.punished_until_ns == 0) pace.bucket = TokenBucket(kPunishedBurst, kPunishedPerS);
  pace.punished_until_ns = now_ns + kPunishmentNs;
}

}  // namespace taclink::server
