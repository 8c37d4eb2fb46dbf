#include "server/listener/listener.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "sensing/core/clock.h"
#include "sensing/core/thread_start.h"
#include "server/listener/listening_socket.h"
#include "server/listener/read_guard.h"
#include "server/process/socket_options.h"

namespace taclink::server {
namespace {

using Id = ConnectionTable::Id;

constexpr uint64_t kWake = 0, kListening = uint64_t{1} << 63;  // of epoll; else a connection's id
// Kept for logs, token files, cameras and the HTTP gateway.
constexpr size_t kReservedDescriptors = 384, kLeastConnections = 16;
constexpr int kAcceptsAtOnce = 64;
constexpr std::chrono::milliseconds kAcceptPause{50};  // where nothing can be refused either
constexpr int64_t kNsPerMs = 1'000'000;

template <typename T>
void SetOption(int socket, int option, T value) {
  ::setsockopt(socket, IPPROTO_TCP, option, &value, sizeof value);
}

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

struct Listener::Running : std::enable_shared_from_this<Running> {
  Running(const ListenerOptions& all_options, const ConnectionLimits& limits, ListeningSockets listening)
      : options(all_options), sockets(std::move(listening)), address(sockets.address()), table(limits) {}
  ~Running();

  Result<void> Prepare();
  void Join();
  void Run(const std::stop_token& stop);
  void Accept(int listening);
  void Take(int fd, const sockaddr_storage& from);
  void StopListening();
  void OnFull();
  void End(Id id);
  void Remove(Id id);
  void HandOverPending();
  int TimeoutMs();
  void HandOne(Id id, int fd);
  void Unguard(Id id, int fd);
  void Punish();
  void Violated(Id id);
  void Wake() const;
  bool Watch(int fd, uint64_t id, uint32_t events) const;

  // Constant after Begin.
  const ListenerOptions options;
  HandOver hand_over;
  ListeningSockets sockets;  // used by the thread, once it runs
  const std::string address;
  int poll = -1, wake = -1;
  std::atomic<bool> closing = false, closed = false;

  ListenerCounts counts;

  std::mutex mutex;
  // Guarded by mutex.
  ConnectionTable table;
  std::vector<Id> violators;                                 // to be punished
  std::map<Id, std::shared_ptr<GuardedConnection>> guarded;  // that were handed over

  // Used by the thread. A connection's watch is a second descriptor of its socket: it stays valid whatever
  // gRPC does, and tells that both directions are closed.
  struct Connection {
    int watch = -1;
    int fd = -1;  // gRPC's number, for ReadGuard; or pending
    std::string peer;
  };
  std::map<Id, Connection> connections;
  std::deque<Id> pending;   // not handed over yet
  int64_t next_due_ns = 0;  // of a pending one; 0: none
  int spare = -1;           // given up to refuse a connection where descriptors have run out

  std::jthread thread;
};

void Listener::Running::Join() {
  thread.request_stop();
  Wake();
  if (thread.joinable()) thread.join();
}

Listener::Running::~Running() {
  for (const Id id : pending) ::close(connections[id].fd);
  for (const auto& [id, connection] : connections) {
    Unguard(id, connection.fd);
    ::close(connection.watch);
  }
  for (const int file : {poll, wake, spare})
    if (file >= 0) ::close(file);
}

bool Listener::Running::Watch(int fd, uint64_t id, uint32_t events) const {
  epoll_event event{.events = events, .data = {.u64 = id}};
  return ::epoll_ctl(poll, EPOLL_CTL_ADD, fd, &event) == 0;
}

Result<void> Listener::Running::Prepare() {
  poll = ::epoll_create1(EPOLL_CLOEXEC);
  wake = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  spare = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  bool good = poll >= 0 && wake >= 0 && Watch(wake, kWake, EPOLLIN);
  for (const int socket : sockets.sockets())
    good = good && Watch(socket, kListening | static_cast<uint64_t>(socket), EPOLLIN);
  if (good) return {};
  return Error{ErrorCode::kResourceExhausted,
               "cannot listen on " + options.address + ": " + std::generic_category().message(errno)};
}

void Listener::Running::Wake() const {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake, &one, sizeof one);
}

void Listener::Running::Run(const std::stop_token& stop) {
  std::array<epoll_event, 64> events{};
  while (!stop.stop_requested()) {
    const int count = ::epoll_wait(poll, events.data(), static_cast<int>(events.size()), TimeoutMs());
    if (closing && !closed) StopListening();
    for (int i = 0; i < count; ++i) {
      const uint64_t id = events[static_cast<size_t>(i)].data.u64;
      if (id == kWake) {
        uint64_t woken = 0;
        [[maybe_unused]] const ssize_t size = ::read(wake, &woken, sizeof woken);
      } else if ((id & kListening) != 0) {
        if (!closed) Accept(static_cast<int>(id & ~kListening));
      } else {
        Remove(id);
      }
    }
    Punish();
    HandOverPending();
  }
}

void Listener::Running::StopListening() {
  sockets.Close();
  for (const Id id : std::exchange(pending, {})) {
    ::close(connections[id].fd);
    End(id);
  }
  closed = true;
  closed.notify_all();
}

void Listener::Running::Accept(int listening) {
  for (int i = 0; i < kAcceptsAtOnce; ++i) {
    sockaddr_storage from{};
    socklen_t size = sizeof from;
    const int fd =
        ::accept4(listening, reinterpret_cast<sockaddr*>(&from), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) {
      Take(fd, from);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      OnFull();
      // With the descriptor that was kept the client is told at once, instead of waiting.
      ::close(std::exchange(spare, -1));
      ::close(::accept4(listening, nullptr, nullptr, SOCK_CLOEXEC));
      spare = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
      if (spare < 0) std::this_thread::sleep_for(kAcceptPause);  // the connection still waits
      return;
    } else if (errno != ECONNABORTED && errno != EINTR) {
      return;
    }
  }
}

// The server's own files come before connections.
void Listener::Running::OnFull() {
  SPDLOG_ERROR("a connection can't be accepted: {}; raise LimitNOFILE, or end some clients",
               std::generic_category().message(errno));
  ++counts.refused;
  std::optional<Id> oldest;
  {
    const std::lock_guard lock(mutex);
    oldest = table.GiveWay();
  }
  if (oldest) End(*oldest);
}

void Listener::Running::Take(int fd, const sockaddr_storage& from) {
  const std::string peer = PeerText(from);
  const auto admission = [&] {
    const std::lock_guard lock(mutex);
    return table.Admit(peer);
  }();
  if (!admission) {
    ++counts.refused;
    SPDLOG_INFO("grpc {}: connection refused: {}", peer, admission.error().message);
    ::close(fd);
    return;
  }
  if (admission->gives_way) {
    ++counts.refused;
    End(*admission->gives_way);
  }
  const Id id = admission->id;
  const int watch = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (watch < 0 || !Watch(watch, id, 0)) {  // EPOLLHUP and EPOLLERR come unasked
    if (watch >= 0) ::close(watch);
    ::close(fd);
    const std::lock_guard lock(mutex);
    table.Remove(id);
    return;
  }
  if (!sockets.is_unix()) {
    SetOption(fd, TCP_NODELAY, 1);
    BoundUnsent(fd);
    SetOption(fd, TCP_USER_TIMEOUT, static_cast<unsigned>(options.user_timeout.count()));
  }
  connections[id] = {.watch = watch, .fd = fd, .peer = peer};
  pending.push_back(id);
  ++counts.connections;
  HandOverPending();  // those that came before first
}

void Listener::Running::HandOverPending() {
  const int64_t now_ns = SystemClock().MonotonicNs();
  next_due_ns = 0;
  for (size_t left = pending.size(); left > 0; --left) {
    const Id id = pending.front();
    pending.pop_front();
    const int64_t wait_ns = [&] {
      const std::lock_guard lock(mutex);
      return table.WaitNs(id, now_ns);
    }();
    if (wait_ns == 0) {
      HandOne(id, connections[id].fd);
      continue;
    }
    pending.push_back(id);
    next_due_ns = next_due_ns == 0 ? now_ns + wait_ns : std::min(next_due_ns, now_ns + wait_ns);
  }
}

int Listener::Running::TimeoutMs() {
  if (next_due_ns == 0) return -1;
  const int64_t left_ns = std::max<int64_t>(next_due_ns - SystemClock().MonotonicNs(), 0);
  return static_cast<int>(left_ns / kNsPerMs) + 1;
}

void Listener::Running::HandOne(Id id, int fd) {
  const auto connection = std::make_shared<GuardedConnection>(
      options.http2, [weak = weak_from_this(), id, peer = connections[id].peer](const std::string& why) {
        SPDLOG_WARN("grpc {}: the connection is closed: it sent {}", peer, why);
        if (const auto self = weak.lock()) self->Violated(id);
      });
  if (sockets.is_unix()) connection->Prove();
  {
    const std::lock_guard lock(mutex);
    guarded[id] = connection;
  }
  if (options.has_tls) {
    const ReadGuard::TlsScope scope(connection);
    hand_over(fd);
  } else {
    ReadGuard::Instance().GuardPlain(fd, connection);
    hand_over(fd);
  }
}

void Listener::Running::Unguard(Id id, int fd) {
  std::shared_ptr<GuardedConnection> connection;
  {
    const std::lock_guard lock(mutex);
    const auto at = guarded.find(id);
    if (at == guarded.end()) return;
    connection = std::move(at->second);
    guarded.erase(at);
  }
  if (!options.has_tls) ReadGuard::Instance().Forget(fd, connection.get());
}

// On the thread that reads the connection.
void Listener::Running::Violated(Id id) {
  ++counts.violations;
  {
    const std::lock_guard lock(mutex);
    violators.push_back(id);
  }
  Wake();
}

void Listener::Running::Punish() {
  const int64_t now_ns = SystemClock().MonotonicNs();
  const std::lock_guard lock(mutex);
  for (const Id id : std::exchange(violators, {})) table.Punish(id, now_ns);
}

// gRPC finds it closed, and closes its own descriptor.
void Listener::Running::End(Id id) {
  const auto at = connections.find(id);
  if (at != connections.end()) ::shutdown(at->second.watch, SHUT_RDWR);
}

void Listener::Running::Remove(Id id) {
  const auto at = connections.find(id);
  if (at == connections.end()) return;
  Punish();  // while the table still knows its address
  const auto waits = std::find(pending.begin(), pending.end(), id);
  if (waits != pending.end()) {
    pending.erase(waits);
    ::close(at->second.fd);
  }
  Unguard(id, at->second.fd);
  // The system keeps the registration, and reports the end over and over, until gRPC has closed its
  // descriptor, which waits for calls that are under way.
  ::epoll_ctl(poll, EPOLL_CTL_DEL, at->second.watch, nullptr);
  ::close(at->second.watch);
  connections.erase(at);
  --counts.connections;
  const std::lock_guard lock(mutex);
  table.Remove(id);
}

Listener::Listener(std::shared_ptr<Running> running) : running_(std::move(running)) {}

Result<std::unique_ptr<Listener>> Listener::Open(const ListenerOptions& options) {
  const auto limits = WithinDescriptors(options.connections);
  if (!limits) return limits.error();
  auto sockets = ListeningSockets::Open(options.address);
  if (!sockets) return sockets.error();
  auto running = std::make_shared<Running>(options, *limits, std::move(*sockets));
  if (const auto prepared = running->Prepare(); !prepared) return prepared.error();
  return std::unique_ptr<Listener>(new Listener(std::move(running)));
}

Listener::~Listener() {
  running_->Join();
}

Result<void> Listener::Begin(HandOver hand_over) {
  running_->hand_over = std::move(hand_over);
  auto thread =
      StartThread("listener", [self = running_.get()](const std::stop_token& stop) { self->Run(stop); });
  if (!thread) return thread.error();
  running_->thread = *std::move(thread);
  return {};
}

void Listener::Close() {
  if (!running_->thread.joinable()) return;  // nothing was handed over
  running_->closing = true;
  running_->Wake();
  running_->closed.wait(false);
}

const std::string& Listener::address() const {
  return running_->address;
}

const ListenerCounts& Listener::counts() const {
  return running_->counts;
}

void Listener::Prove(const std::string& peer) {
  const std::lock_guard lock(running_->mutex);
  const auto id = running_->table.Prove(peer);
  if (!id) return;
  const auto at = running_->guarded.find(*id);
  if (at != running_->guarded.end()) at->second->Prove();
}

}  // namespace taclink::server
