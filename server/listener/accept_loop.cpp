#include "server/listener/accept_loop.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <exception>
#include <optional>
#include <system_error>
#include <utility>

#include "sensing/core/clock.h"
#include "sensing/core/thread_start.h"
#include "server/process/socket_options.h"
#include "server/security/party.h"

namespace taclink::server {
namespace {

constexpr uint64_t kWake = 0, kListening = uint64_t{1} << 63;  // of epoll; else a connection's id
constexpr int kAcceptsAtOnce = 64;
constexpr std::chrono::milliseconds kAcceptPause{50};  // where nothing can be refused either
constexpr int64_t kNsPerMs = 1'000'000;

template <typename T>
void SetOption(int socket, int option, T value) {
  ::setsockopt(socket, IPPROTO_TCP, option, &value, sizeof value);
}

}  // namespace

AcceptLoop::AcceptLoop(const ListenerOptions& options, const ConnectionLimits& limits,
                       ListeningSockets sockets)
    : options_(options), address_(sockets.address()), table_(limits), sockets_(std::move(sockets)) {}

Result<void> AcceptLoop::Begin(Listener::HandOver hand_over) {
  hand_over_ = std::move(hand_over);
  auto thread = StartThread("listener", [this](const std::stop_token& stop) { Run(stop); });
  if (!thread) return thread.error();
  thread_ = *std::move(thread);
  return {};
}

void AcceptLoop::Close() {
  if (!thread_.joinable()) return;  // nothing was handed over
  closing_ = true;
  Wake();
  closed_.wait(false);
}

void AcceptLoop::MarkAuthorized(const std::string& peer) {
  const std::lock_guard lock(mutex_);
  const auto id = table_.MarkAuthorized(peer);
  if (!id) return;
  const auto at = handed_over_.find(*id);
  if (at != handed_over_.end()) at->second.guard->MarkAuthorized();
}

std::shared_ptr<const SharedSocket> AcceptLoop::SocketOf(const std::string& peer) const {
  const std::lock_guard lock(mutex_);
  const auto id = table_.Find(peer);
  if (!id) return nullptr;
  const auto at = handed_over_.find(*id);
  return at == handed_over_.end() ? nullptr : at->second.socket;
}

void AcceptLoop::Join() {
  thread_.request_stop();
  Wake();
  if (thread_.joinable()) thread_.join();
}

AcceptLoop::~AcceptLoop() {
  for (const Id id : pending_) ::close(connections_[id].fd);
  for (const auto& [id, connection] : connections_) Unguard(id, connection.fd);
  for (const int file : {poll_, wake_, spare_})
    if (file >= 0) ::close(file);
}

bool AcceptLoop::Watch(int fd, uint64_t id, uint32_t events) const {
  epoll_event event{.events = events, .data = {.u64 = id}};
  return ::epoll_ctl(poll_, EPOLL_CTL_ADD, fd, &event) == 0;
}

Result<void> AcceptLoop::Prepare() {
  poll_ = ::epoll_create1(EPOLL_CLOEXEC);
  wake_ = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  spare_ = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  bool good = poll_ >= 0 && wake_ >= 0 && Watch(wake_, kWake, EPOLLIN);
  for (const int socket : sockets_.sockets())
    good = good && Watch(socket, kListening | static_cast<uint64_t>(socket), EPOLLIN);
  if (good) return {};
  return Error{ErrorCode::kResourceExhausted,
               "cannot listen on " + options_.address + ": " + std::generic_category().message(errno)};
}

void AcceptLoop::Wake() const {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake_, &one, sizeof one);
}

void AcceptLoop::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    try {
      Round();
    } catch (const std::exception& e) {  // std::bad_alloc; what was not done is reported by epoll again
      SPDLOG_ERROR("grpc: connections could not be served for a moment: {}", e.what());
      std::this_thread::sleep_for(kAcceptPause);
    }
  }
}

void AcceptLoop::Round() {
  std::array<epoll_event, 64> events{};
  const int count = ::epoll_wait(poll_, events.data(), static_cast<int>(events.size()), TimeoutMs());
  if (closing_ && !closed_) StopListening();
  for (int i = 0; i < count; ++i) {
    const uint64_t id = events[static_cast<size_t>(i)].data.u64;
    if (id == kWake) {
      uint64_t woken = 0;
      [[maybe_unused]] const ssize_t size = ::read(wake_, &woken, sizeof woken);
    } else if ((id & kListening) != 0) {
      if (!closed_) Accept(static_cast<int>(id & ~kListening));
    } else {
      Remove(id);
    }
  }
  Punish();
  HandOverPending();
}

void AcceptLoop::StopListening() {
  sockets_.Close();
  for (const Id id : std::exchange(pending_, {})) {
    ::close(connections_[id].fd);
    End(id);
  }
  closed_ = true;
  closed_.notify_all();
}

void AcceptLoop::Accept(int listening) {
  for (int i = 0; i < kAcceptsAtOnce; ++i) {
    sockaddr_storage from{};
    socklen_t size = sizeof from;
    const int fd =
        ::accept4(listening, reinterpret_cast<sockaddr*>(&from), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) {
      Take(fd, from);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      OnFull();
      // With the spare descriptor the connection is refused at once; otherwise its client would wait.
      ::close(std::exchange(spare_, -1));
      ::close(::accept4(listening, nullptr, nullptr, SOCK_CLOEXEC));
      spare_ = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
      if (spare_ < 0) std::this_thread::sleep_for(kAcceptPause);  // the connection still waits
      return;
    } else if (errno != ECONNABORTED && errno != EINTR) {
      return;
    }
  }
}

// The server's own files come before connections.
void AcceptLoop::OnFull() {
  SPDLOG_ERROR("a connection can't be accepted: {}; raise LimitNOFILE, or end some clients",
               std::generic_category().message(errno));
  ++counts_.refused;
  std::optional<Id> oldest;
  {
    const std::lock_guard lock(mutex_);
    oldest = table_.GiveWay();
  }
  if (oldest) End(*oldest);
}

void AcceptLoop::Take(int fd, const sockaddr_storage& from) {
  const std::string peer = PeerText(reinterpret_cast<const sockaddr&>(from));
  const auto admission = [&] {
    const std::lock_guard lock(mutex_);
    return table_.Admit(peer);
  }();
  if (!admission) {
    ++counts_.refused;
    SPDLOG_INFO("grpc {}: connection refused: {}", peer, admission.error().message);
    ::close(fd);
    return;
  }
  if (admission->gives_way) EndForAnother(*admission->gives_way);
  const Id id = admission->id;
  auto watch = std::make_shared<const SharedSocket>(::fcntl(fd, F_DUPFD_CLOEXEC, 0));
  if (watch->fd() < 0 || !Watch(watch->fd(), id, 0)) {  // EPOLLHUP and EPOLLERR come unasked
    ::close(fd);
    const std::lock_guard lock(mutex_);
    table_.Remove(id);
    return;
  }
  if (!sockets_.is_unix()) {
    SetOption(fd, TCP_NODELAY, 1);
    BoundUnsent(fd);
    SetOption(fd, TCP_USER_TIMEOUT, static_cast<unsigned>(options_.user_timeout.count()));
  }
  connections_[id] = {.watch = std::move(watch), .fd = fd, .peer = peer};
  pending_.push_back(id);
  ++counts_.connections;
  HandOverPending();  // those that came before first
}

void AcceptLoop::HandOverPending() {
  const int64_t now_ns = SystemClock().MonotonicNs();
  next_due_ns_ = 0;
  for (size_t left = pending_.size(); left > 0; --left) {
    const Id id = pending_.front();
    pending_.pop_front();
    const ConnectionTable::Turn turn = [&] {
      const std::lock_guard lock(mutex_);
      return table_.TakeTurn(id, now_ns);
    }();
    if (turn.gives_way) EndForAnother(*turn.gives_way);
    if (turn.wait_ns == 0) {
      HandOne(id, connections_[id].fd);
      continue;
    }
    pending_.push_back(id);
    const int64_t due_ns = now_ns + turn.wait_ns;
    next_due_ns_ = next_due_ns_ == 0 ? due_ns : std::min(next_due_ns_, due_ns);
  }
}

int AcceptLoop::TimeoutMs() {
  if (next_due_ns_ == 0) return -1;
  const int64_t left_ns = std::max<int64_t>(next_due_ns_ - SystemClock().MonotonicNs(), 0);
  return static_cast<int>(left_ns / kNsPerMs) + 1;
}

void AcceptLoop::HandOne(Id id, int fd) {
  const auto connection = std::make_shared<GuardedConnection>(
      options_.http2, [weak = weak_from_this(), id, peer = connections_[id].peer](const std::string& why) {
        SPDLOG_WARN("grpc {}: the connection is closed: it sent {}", peer, why);
        if (const auto self = weak.lock()) self->Violated(id);
      });
  if (sockets_.is_unix()) connection->MarkAuthorized();
  {
    const std::lock_guard lock(mutex_);
    handed_over_[id] = {.guard = connection, .socket = sockets_.is_unix() ? nullptr : connections_[id].watch};
  }
  if (options_.has_tls) {
    const ReadGuard::TlsScope scope(connection);
    hand_over_(fd);
  } else {
    ReadGuard::Instance().GuardPlain(fd, connection);
    hand_over_(fd);
  }
}

void AcceptLoop::Unguard(Id id, int fd) {
  std::shared_ptr<GuardedConnection> connection;
  {
    const std::lock_guard lock(mutex_);
    const auto at = handed_over_.find(id);
    if (at == handed_over_.end()) return;
    connection = std::move(at->second.guard);
    handed_over_.erase(at);
  }
  if (!options_.has_tls) ReadGuard::Instance().Forget(fd, connection.get());
}

// On the thread that reads the connection.
void AcceptLoop::Violated(Id id) {
  ++counts_.violations;
  {
    const std::lock_guard lock(mutex_);
    violators_.push_back(id);
  }
  Wake();
}

void AcceptLoop::Punish() {
  const int64_t now_ns = SystemClock().MonotonicNs();
  const std::lock_guard lock(mutex_);
  for (const Id id : std::exchange(violators_, {})) table_.Punish(id, now_ns);
}

// gRPC finds it closed, and closes its own descriptor.
void AcceptLoop::End(Id id) {
  const auto at = connections_.find(id);
  if (at != connections_.end()) ::shutdown(at->second.watch->fd(), SHUT_RDWR);
}

void AcceptLoop::EndForAnother(Id id) {
  ++counts_.refused;
  End(id);
}

void AcceptLoop::Remove(Id id) {
  const auto at = connections_.find(id);
  if (at == connections_.end()) return;
  Punish();  // while the table still knows its address
  const auto waits = std::find(pending_.begin(), pending_.end(), id);
  if (waits != pending_.end()) {
    pending_.erase(waits);
    ::close(at->second.fd);
  }
  Unguard(id, at->second.fd);
  // The system keeps the registration, and reports the end over and over, until gRPC has closed its
  // descriptor, which waits for calls that are under way.
  ::epoll_ctl(poll_, EPOLL_CTL_DEL, at->second.watch->fd(), nullptr);
  connections_.erase(at);
  --counts_.connections;
  const std::lock_guard lock(mutex_);
  table_.Remove(id);
}

}  // namespace taclink::server
