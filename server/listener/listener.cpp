#include "server/listener/listener.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "server/listener/accept_loop.h"

namespace taclink::server {
namespace {

// Kept for logs, token files, cameras and the HTTP gateway.
constexpr size_t kReservedDescriptors = 384, kLeastConnections = 16;

// Each connection takes two descriptors, gRPC's and the one by which its end is seen.
Result<ConnectionLimits> WithinDescriptors(ConnectionLimits limits) {
  rlimit files{};
  if (::getrlimit(RLIMIT_NOFILE, &files) != 0 || files.rlim_cur == RLIM_INFINITY) return limits;
  const auto have = static_cast<size_t>(files.rlim_cur);
  const size_t possible = have > kReservedDescriptors ? (have - kReservedDescriptors) / 2 : 0;
  if (possible < kLeastConnections)
    return Error{
        ErrorCode::kResourceExhausted,
        fmt::format("this process may open {} files, and needs {} at least: raise LimitNOFILE or ulimit -n",
                    have, kReservedDescriptors + 2 * kLeastConnections)};
  if (possible < limits.all)
    SPDLOG_WARN(
        "at most {} connections of gRPC, not {} (limits.max_connections): this process may open {} files",
        possible, limits.all, have);
  limits.all = std::min(limits.all, possible);
  return limits;
}

}  // namespace

Listener::Listener(std::shared_ptr<AcceptLoop> loop) : loop_(std::move(loop)) {}

Result<std::unique_ptr<Listener>> Listener::Open(const ListenerOptions& options) {
  const auto limits = WithinDescriptors(options.connections);
  if (!limits) return limits.error();
  auto sockets = ListeningSockets::Open(options.address);
  if (!sockets) return sockets.error();
  auto loop = std::make_shared<AcceptLoop>(options, *limits, std::move(*sockets));
  if (const auto prepared = loop->Prepare(); !prepared) return prepared.error();
  return std::unique_ptr<Listener>(new Listener(std::move(loop)));
}

Listener::~Listener() {
  loop_->Join();
}

Result<void> Listener::Begin(HandOver hand_over) {
  return loop_->Begin(std::move(hand_over));
}

void Listener::Close() {
  loop_->Close();
}

const std::string& Listener::address() const {
  return loop_->address();
}

const ListenerCounts& Listener::counts() const {
  return loop_->counts();
}

void Listener::MarkAuthorized(const std::string& peer) {
  loop_->MarkAuthorized(peer);
}

std::shared_ptr<const SharedSocket> Listener::SocketOf(const std::string& peer) const {
  return loop_->SocketOf(peer);
}

}  // namespace taclink::server
