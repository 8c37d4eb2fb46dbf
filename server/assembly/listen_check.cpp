#include "server/assembly/listen_check.h"

#include <sys/un.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "sensing/core/address.h"
#include "server/process/unix_socket.h"

namespace taclink::server {
namespace {

namespace asio = boost::asio;
namespace fs = std::filesystem;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::string_view kUnixScheme = "unix:";
constexpr const char* kServer = "taclinkd";

struct Holder {
  std::string program;
  std::string pid;
};

// Inodes of the TCP sockets that listen on `port`, as proc(5) tells them: sl, local address:PORT in
// hexadecimal, remote address, state (0A: LISTEN), queues, timer, retransmissions, uid, timeout, inode.
std::vector<std::string> ListenersOn(int port) {
  std::vector<std::string> inodes;
  for (const char* const table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream in(table);
    for (std::string line; std::getline(in, line);) {
      std::istringstream words(line);
      std::string slot, local, remote, state, skipped, inode;
      words >> slot >> local >> remote >> state;
      for (int i = 0; i < 5; ++i) words >> skipped;
      words >> inode;
      const auto colon = local.rfind(':');
      int found = -1;
      if (colon != std::string::npos)
        std::from_chars(local.data() + colon + 1, local.data() + local.size(), found, 16);
      if (state == "0A" && found == port) inodes.push_back(inode);
    }
  }
  return inodes;
}

Holder HolderNamed(const std::string& pid) {
  Holder holder{.program = {}, .pid = pid};
  std::getline(std::ifstream(fs::path("/proc") / pid / "comm"), holder.program);
  return holder;
}

bool Holds(const fs::path& process, const std::string& socket) {
  std::error_code gone;
  for (fs::directory_iterator at(process / "fd", gone), end; !gone && at != end; at.increment(gone)) {
    std::error_code unreadable;
    if (fs::read_symlink(at->path(), unreadable) == socket) return true;
  }
  return false;
}

// None: nobody is seen, for other users' processes hide their files.
std::optional<Holder> HolderOf(int port) {
  for (const std::string& inode : ListenersOn(port)) {
    std::error_code gone;
    for (fs::directory_iterator at("/proc", gone), end; !gone && at != end; at.increment(gone)) {
      const std::string pid = at->path().filename();
      const bool process = pid.find_first_not_of("0123456789") == std::string::npos;
      if (!process || !Holds(at->path(), "socket:[" + inode + "]")) continue;
      return HolderNamed(pid);
    }
  }
  return std::nullopt;
}

// Of the addresses that a name stands for: gRPC takes all that it can have, the gateway the first.
enum class Binds { kAll, kFirst };

class Listeners {
 public:
  explicit Listeners(ConfigFindings& out) : out_(out) {}

  void Try(const std::string& key, const std::string& address, Binds binds) {
    if (address.starts_with(kUnixScheme)) return TryUnix(key, address.substr(kUnixScheme.size()));
    const auto parsed = ParseHostPort(address);
    if (!parsed) return Fail(key, address, parsed.error().message);
    error_code error;
    const auto endpoints =
        tcp::resolver(io_).resolve(parsed->host, std::to_string(parsed->port), tcp::resolver::passive, error);
    if (error) return Fail(key, address, "no such host (" + error.message() + ")");
    std::set<tcp::endpoint> tried;  // a name may stand for several, and twice for one
    bool listens = false, in_use = false;
    for (const auto& entry : endpoints) {
      if (!tried.insert(entry.endpoint()).second) continue;
      error = Listen(entry.endpoint());
      listens = listens || !error;
      in_use = in_use || error == asio::error::address_in_use;
      if (binds == Binds::kFirst) break;
    }
    if (in_use) return FailInUse(key, address, HolderOf(endpoints.begin()->endpoint().port()));
    if (!listens) Fail(key, address, error.message());
  }

 private:
  error_code Listen(const tcp::endpoint& endpoint) {
    tcp::acceptor acceptor(io_);
    error_code error;
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(1, error);
    if (!error) acceptors_.push_back(std::move(acceptor));
    return error;
  }

  void TryUnix(const std::string& key, const std::string& path) {
    if (path.size() >= sizeof(sockaddr_un::sun_path))
      return Fail(
          key, path,
          "a socket's path must be shorter than " + std::to_string(sizeof(sockaddr_un::sun_path)) + " bytes");
    const std::string folder = fs::absolute(path).parent_path();
    if (access(folder.c_str(), W_OK | X_OK) != 0)
      return Fail(key, path, folder + ": " + std::generic_category().message(errno));
    std::error_code unreadable;
    const fs::file_status there = fs::status(path, unreadable);
    if (fs::exists(there) && !fs::is_socket(there))
      return Fail(key, path, "a file that is no socket is there; remove it or choose another");
    if (const auto listener = ListenerOf(path))
      FailInUse(key, std::string(kUnixScheme) + path, HolderNamed(std::to_string(*listener)));
  }

  void Fail(const std::string& key, const std::string& address, const std::string& why) {
    out_.errors.push_back(key + ": cannot listen on " + address + ": " + why);
  }

  void FailInUse(const std::string& key, const std::string& address, const std::optional<Holder>& holder) {
    if (holder && holder->pid == std::to_string(getpid()))
      return Fail(key, address, "server.listen has that port already; give them different ones");
    if (holder && holder->program == kServer) {
      out_.notes.push_back(key + ": " + address + " is in use by another taclinkd (pid " + holder->pid +
                           "), which must end before this one can start");
      return;
    }
    Fail(key, address,
         "it is in use" + (holder ? " by " + holder->program + " (pid " + holder->pid + ")" : std::string()) +
             "; stop what uses it or choose another");
  }

  asio::io_context io_;
  std::vector<tcp::acceptor> acceptors_;
  ConfigFindings& out_;
};

}  // namespace

void CheckListening(const Config& config, ConfigFindings& out) {
  Listeners listeners(out);
  listeners.Try("server.listen", config.listen, Binds::kAll);
  if (config.http.listen) {
    if (!config.http.listen->empty()) listeners.Try("http.listen", *config.http.listen, Binds::kFirst);
    return;
  }
  ConfigFindings web;  // the server starts without its page where its usual address is taken
  Listeners(web).Try("http.listen", kDefaultHttpListen, Binds::kFirst);
  if (!web.errors.empty() || !web.notes.empty())
    out.notes.push_back("there would be no web page: " +
                        (web.errors.empty() ? web.notes : web.errors).front());
}

}  // namespace taclink::server
