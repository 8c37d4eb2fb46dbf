#include "server/gateway/gateway.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "server/config.h"
#include "server/gateway/session.h"
#include "server/thread_setup.h"

namespace taclink::server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr auto kAwait = asio::as_tuple(asio::use_awaitable);
constexpr milliseconds kAcceptPause{100};  // after a failure, such as too many open files

struct HostPort {
  std::string host, port;
};

HostPort SplitAddress(const std::string& address) {
  const auto colon = address.rfind(':');
  HostPort out{address.substr(0, colon), address.substr(colon + 1)};
  if (out.host.starts_with('[')) out.host = out.host.substr(1, out.host.size() - 2);
  return out;
}

// As gRPC tells a peer.
std::string PeerText(const tcp::endpoint& remote) {
  boost::system::error_code ignored;
  const std::string address = remote.address().to_string(ignored), port = std::to_string(remote.port());
  return remote.address().is_v6() ? "ipv6:[" + address + "]:" + port : "ipv4:" + address + ":" + port;
}

// Null: the material is of no use, which its reader would have found before.
std::shared_ptr<asio::ssl::context> MakeTls(const TlsMaterial& material) {
  auto tls = std::make_shared<asio::ssl::context>(asio::ssl::context::tls_server);
  boost::system::error_code error;
  const auto good = [&error] { return !error; };
  tls->set_options(
      asio::ssl::context::default_workarounds | asio::ssl::context::no_tlsv1 | asio::ssl::context::no_tlsv1_1,
      error);
  if (good()) tls->use_certificate_chain(asio::buffer(material.certificate), error);
  if (good()) tls->use_private_key(asio::buffer(material.key), asio::ssl::context::pem, error);
  if (good() && !material.client_ca.empty()) {
    tls->add_certificate_authority(asio::buffer(material.client_ca), error);
    if (good()) tls->set_verify_mode(asio::ssl::verify_peer | asio::ssl::verify_fail_if_no_peer_cert, error);
  }
  if (good()) return tls;
  spdlog::error("http: the certificate cannot be used: {}", error.message());
  return nullptr;
}

// How often late sessions are looked for.
milliseconds SweepInterval(const GatewayOptions& options) {
  const auto shortest = std::min({options.header_timeout, options.idle_timeout, options.write_timeout});
  return std::clamp(shortest / 4, milliseconds(10), milliseconds(500));
}

}  // namespace

struct Gateway::Running {
  Running(GatewayOptions options, GatewayServices services, StaticFiles files)
      : shared(std::make_shared<GatewayShared>(std::move(options), std::move(services), std::move(files))),
        acceptor(shared->loop),
        sweep_timer(shared->loop) {}

  Result<void> Listen();
  asio::awaitable<void> Accept();
  asio::awaitable<void> Sweep();
  asio::awaitable<void> Serve(std::shared_ptr<Session> session);
  bool MakeRoom();
  std::shared_ptr<asio::ssl::context> CurrentTls();
  void StopListening();
  void Stop();

  const std::shared_ptr<GatewayShared> shared;
  std::string address;

  // Used by the loop's thread, once it runs.
  tcp::acceptor acceptor;
  asio::steady_timer sweep_timer;
  bool stopping = false;
  std::set<std::shared_ptr<Session>> sessions;
  std::shared_ptr<const TlsMaterial> tls_material;
  std::shared_ptr<asio::ssl::context> tls;

  std::jthread thread;
};

Result<void> Gateway::Running::Listen() {
  const std::string& listen = shared->options.listen;
  const auto [host, port] = SplitAddress(listen);
  boost::system::error_code error;
  tcp::resolver resolver(shared->loop);
  const auto found = resolver.resolve(host, port, tcp::resolver::passive, error);
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

// Ends the connection that has waited longest for a request, if all places are taken: those who open
// connections and say nothing keep nobody out.
bool Gateway::Running::MakeRoom() {
  if (sessions.size() < shared->options.max_connections) return true;
  std::shared_ptr<Session> oldest;
  for (const auto& session : sessions) {
    const auto since = session->waiting_since();
    if (since && (!oldest || *since < *oldest->waiting_since())) oldest = session;
  }
  ++shared->services.counts->refused;
  if (!oldest) return false;
  oldest->Close();
  sessions.erase(oldest);
  return true;
}

asio::awaitable<void> Gateway::Running::Accept() {
  while (!stopping && !shared->draining) {
    auto [error, socket] = co_await acceptor.async_accept(kAwait);
    if (error) {
      if (!acceptor.is_open()) break;
      asio::steady_timer pause(shared->loop, kAcceptPause);
      co_await pause.async_wait(kAwait);
      continue;
    }
    if (!MakeRoom()) continue;  // the socket closes
    boost::system::error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    const tcp::endpoint remote = socket.remote_endpoint(ignored);
    auto current = CurrentTls();
    if (tls_material && !current) continue;
    auto session = std::make_shared<Session>(shared, MakeConnection(std::move(socket), std::move(current)),
                                             PeerText(remote));
    asio::co_spawn(shared->loop, Serve(std::move(session)), asio::detached);
  }
}

asio::awaitable<void> Gateway::Running::Serve(std::shared_ptr<Session> session) {
  sessions.insert(session);
  ++shared->services.counts->connections;
  try {
    co_await session->Run();
  } catch (const std::exception& e) {
    spdlog::error("http: a connection failed: {}", e.what());
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
    for (const auto& session : sessions) session->CloseIfLate(now);
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
  for (const auto& session : sessions) session->Close();
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
  self->thread = std::jthread([self] {
    SetUpThread("http", {});
    self->shared->loop.run();
  });
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
