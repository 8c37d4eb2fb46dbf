#include "server/gateway/gateway.h"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "sensing/core/address.h"
#include "sensing/core/thread_start.h"
#include "server/config/config.h"
#include "server/gateway/session.h"
#include "server/process/socket_options.h"
#include "server/process/system_limits.h"
#include "server/security/party.h"
#include "server/security/shares.h"
#include "server/security/tls_policy.h"

namespace taclink::server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr auto kAwait = asio::as_tuple(asio::use_awaitable);
constexpr size_t kProbePlaces = 8;         // of connections to /healthz and /readyz
constexpr milliseconds kAcceptPause{100};  // after a failure, such as too many open files

// TLS 1.2 or 1.3, and of the former only what tls_policy.h has. False: OpenSSL knows no such ciphers.
bool LimitProtocol(SSL_CTX* context) {
  constexpr int kBits112 = 2;  // OpenSSL's security level: refuses short keys and SHA-1, of clients too
  SSL_CTX_set_security_level(context, kBits112);
  SSL_CTX_set_options(context,
                      SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  return SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION) == 1 &&
         SSL_CTX_set_cipher_list(context, kTlsCiphers) == 1;
}

// Null: the material is of no use, which its reader would have found before.
std::shared_ptr<asio::ssl::context> MakeTls(const TlsMaterial& material) {
  auto tls = std::make_shared<asio::ssl::context>(asio::ssl::context::tls_server);
  boost::system::error_code error;
  const auto good = [&error] { return !error; };
  if (!LimitProtocol(tls->native_handle()))
    error.assign(static_cast<int>(ERR_get_error()), asio::error::get_ssl_category());
  if (good()) tls->use_certificate_chain(asio::buffer(material.certificate), error);
  if (good()) tls->use_private_key(asio::buffer(material.key), asio::ssl::context::pem, error);
  if (good() && !material.client_ca.empty()) {
    tls->add_certificate_authority(asio::buffer(material.client_ca), error);
    if (good()) tls->set_verify_mode(asio::ssl::verify_peer | asio::ssl::verify_fail_if_no_peer_cert, error);
  }
  if (good()) return tls;
  SPDLOG_ERROR("http: the certificate cannot be used: {}", error.message());
  return nullptr;
}

// How often late sessions are looked for.
milliseconds SweepInterval(const GatewayOptions& options) {
  const auto shortest = std::min({options.header_timeout, options.idle_timeout, options.write_timeout});
  return std::clamp(shortest / 4, milliseconds(10), milliseconds(500));
}

}  // namespace

struct Gateway::Running {
  struct Held {
    Place place;
    bool only_probes = false;  // it has one of the places that are reserved for probes
  };
  /// For a new connection.
  struct Room {
    std::string busy = {};  // not empty: for probes only, and why
  };

  Running(GatewayOptions options, GatewayServices services, StaticFiles files)
      : shared(std::make_shared<GatewayShared>(std::move(options), std::move(services), std::move(files))),
        acceptor(shared->loop),
        sweep_timer(shared->loop) {}

  Result<void> Listen();
  asio::awaitable<void> Accept();
  asio::awaitable<void> Sweep();
  asio::awaitable<void> Serve(std::shared_ptr<Session> session);
  Result<Room> MakeRoom(const Place& from);
  bool MakeProbeRoom();
  bool EndLongestWaiting(const std::function<bool(const Held&)>& among);
  std::shared_ptr<asio::ssl::context> CurrentTls();
  void StopListening();
  void Stop();

  const std::shared_ptr<GatewayShared> shared;
  std::string address;

  // Used by the loop's thread, once it runs.
  tcp::acceptor acceptor;
  asio::steady_timer sweep_timer;
  bool stopping = false;
  std::map<std::shared_ptr<Session>, Held> sessions;
  std::shared_ptr<const TlsMaterial> tls_material;
  std::shared_ptr<asio::ssl::context> tls;

  std::jthread thread;
};

Result<void> Gateway::Running::Listen() {
  const std::string& listen = shared->options.listen;
  const auto parsed = ParseHostPort(listen);
  if (!parsed) return Error{parsed.error().code, "http.listen " + listen + ": " + parsed.error().message};
  boost::system::error_code error;
  tcp::resolver resolver(shared->loop);
  const auto found =
      resolver.resolve(parsed->host, std::to_string(parsed->port), tcp::resolver::passive, error);
  if (!error) {
    const tcp::endpoint endpoint = found.begin()->endpoint();
    const auto then = [&error](auto&& step) {
      if (!error) step();
    };
    then([&] { acceptor.open(endpoint.protocol(), error); });
    then([&] { acceptor.set_option(tcp::acceptor::reuse_address(true), error); });
    then([&] { acceptor.bind(endpoint, error); });
    then([&] { acceptor.listen(asio::socket_base::max_listen_connections, error); });
  }
  if (error)
    return Error{ErrorCode::kUnavailable, "cannot listen on " + listen + " for HTTP (" + error.message() +
                                              "); stop what uses it or choose another with --http-listen"};
  address = listen.substr(0, listen.rfind(':') + 1) + std::to_string(acceptor.local_endpoint().port());
  shared->loopback_only = IsLoopback(listen);
  return {};
}

// The certificates may have changed since the last connection.
std::shared_ptr<asio::ssl::context> Gateway::Running::CurrentTls() {
  const auto material = shared->services.security->tls();
  if (material != tls_material) {
    auto fresh = material ? MakeTls(*material) : nullptr;
    if (fresh) tls = std::move(fresh);
    tls_material = material;
  }
  return tls;
}

// False: none of them waits for a request.
bool Gateway::Running::EndLongestWaiting(const std::function<bool(const Held&)>& among) {
  std::shared_ptr<Session> oldest;
  for (const auto& [session, held] : sessions) {
    const auto since = session->waiting_since();
    if (since && among(held) && (!oldest || *since < *oldest->waiting_since())) oldest = session;
  }
  if (!oldest) return false;
  oldest->Close();
  sessions.erase(oldest);
  return true;
}

// Places beyond all limits, for those who watch this server from its own machine: programs that take all
// connections must not make it look dead. A probe asks as soon as it is connected, so the one that has waited
// longest can go.
bool Gateway::Running::MakeProbeRoom() {
  const auto probes = [](const Held& held) { return held.only_probes; };
  const auto count = std::ranges::count_if(sessions, [&](const auto& each) { return probes(each.second); });
  return static_cast<size_t>(count) < kProbePlaces || EndLongestWaiting(probes);
}

// Where all places that the new connection may take are taken, the one among them that has waited longest for
// a request ends: those who open connections and say nothing keep nobody out. Errors: kResourceExhausted.
Result<Gateway::Running::Room> Gateway::Running::MakeRoom(const Place& from) {
  const size_t most = shared->options.max_connections,
               most_per_peer = shared->options.max_connections_per_peer;
  const auto any = [](const Held& held) { return !held.only_probes; };
  const auto of_peer = [&](const Held& held) { return any(held) && held.place.address == from.address; };
  const auto remote = [&](const Held& held) { return any(held) && !held.place.local; };
  const auto count = [this](const auto& which) {
    return static_cast<size_t>(std::count_if(sessions.begin(), sessions.end(),
                                             [&](const auto& each) { return which(each.second); }));
  };
  bool made = true;
  std::string taken, setting = "http.max_connections";
  if (count(of_peer) >= most_per_peer) {
    taken = fmt::format("all {} connections of {}", most_per_peer, from.address);
    setting = "http.max_connections_per_peer";
    made = EndLongestWaiting(of_peer);
  } else if (!from.local && count(remote) >= most - Kept(most)) {
    taken = fmt::format("all {} connections but those kept for this machine", most - Kept(most));
    made = EndLongestWaiting(remote);
  } else if (count(any) >= most) {
    taken = fmt::format("all {} connections", most);
    made = EndLongestWaiting(any);
  }
  if (!taken.empty()) ++shared->services.counts->refused;
  if (made) return Room{};
  std::string busy = taken + " are in use; close one or raise " + setting;
  if (from.local && MakeProbeRoom()) return Room{std::move(busy)};
  return Error{ErrorCode::kResourceExhausted, std::move(busy)};
}

asio::awaitable<void> Gateway::Running::Accept() {
  while (!stopping && !shared->draining) {
    auto [error, socket] = co_await acceptor.async_accept(kAwait);
    if (error) {
      if (!acceptor.is_open()) break;
      SPDLOG_ERROR("http: a connection can't be accepted: {}; raise LimitNOFILE, or end some clients",
                   error.message());
      asio::steady_timer pause(shared->loop, kAcceptPause);
      co_await pause.async_wait(kAwait);
      continue;
    }
    boost::system::error_code ignored;
    const std::string peer = PeerText(*socket.remote_endpoint(ignored).data());
    const Place place = PlaceOf(peer);
    const auto room = MakeRoom(place);
    if (!room) {
      SPDLOG_INFO("http {}: connection refused: {}", peer, room.error().message);
      continue;  // the socket closes
    }
    socket.set_option(tcp::no_delay(true), ignored);
    BoundUnsent(socket.native_handle());
    auto current = CurrentTls();
    if (tls_material && !current) continue;
    auto session = std::make_shared<Session>(shared, MakeConnection(std::move(socket), std::move(current)),
                                             peer, room->busy);
    sessions.emplace(session, Held{place, !room->busy.empty()});
    asio::co_spawn(shared->loop, Serve(std::move(session)), asio::detached);
  }
}

asio::awaitable<void> Gateway::Running::Serve(std::shared_ptr<Session> session) {
  ++shared->services.counts->connections;
  try {
    co_await session->Run();
  } catch (const std::exception& e) {
    SPDLOG_ERROR("http: a connection failed: {}", DescribeLimit(e));
    session->Close();
  }
  --shared->services.counts->connections;
  sessions.erase(session);
}

asio::awaitable<void> Gateway::Running::Sweep() {
  while (!stopping) {
    sweep_timer.expires_after(SweepInterval(shared->options));
    co_await sweep_timer.async_wait(kAwait);
    const auto now = steady_clock::now();
    for (const auto& [session, held] : sessions) session->CloseIfLate(now);
  }
}

void Gateway::Running::StopListening() {
  shared->draining = true;
  boost::system::error_code ignored;
  acceptor.close(ignored);
}

void Gateway::Running::Stop() {
  stopping = true;
  StopListening();
  sweep_timer.cancel();
  for (const auto& [session, held] : sessions) session->Close();
}

Gateway::Gateway(std::unique_ptr<Running> running) : running_(std::move(running)) {}

Result<std::unique_ptr<Gateway>> Gateway::Start(GatewayOptions options, GatewayServices services) {
  auto files = StaticFiles::Open(options.web_root);
  if (!files) return files.error();
  auto running = std::make_unique<Running>(std::move(options), std::move(services), std::move(*files));
  const auto listening = running->Listen();
  if (!listening) return listening.error();
  Running* const self = running.get();
  asio::co_spawn(self->shared->loop, self->Accept(), asio::detached);
  asio::co_spawn(self->shared->loop, self->Sweep(), asio::detached);
  auto thread = StartThread("http", [self] { self->shared->loop.run(); });
  if (!thread) return thread.error();
  self->thread = *std::move(thread);
  return std::unique_ptr<Gateway>(new Gateway(std::move(running)));
}

Gateway::~Gateway() {
  asio::post(running_->shared->loop, [this] { running_->Stop(); });
  running_->thread.join();  // the loop ends with its last session
  running_->shared->calls.WaitUntilDone();
}

void Gateway::Drain() {
  asio::post(running_->shared->loop, [this] { running_->StopListening(); });
}

const std::string& Gateway::address() const {
  return running_->address;
}

}  // namespace taclink::server
