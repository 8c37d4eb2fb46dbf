#pragma once

#include <sys/socket.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "sensing/core/result.h"
#include "server/listener/connection_table.h"
#include "server/listener/listener.h"
#include "server/listener/listening_socket.h"
#include "server/listener/read_guard.h"
#include "server/process/shared_socket.h"

namespace taclink::server {

/// The listener's thread and what it works on. Connections that end may hold it for moments.
class AcceptLoop : public std::enable_shared_from_this<AcceptLoop> {
 public:
  AcceptLoop(const ListenerOptions& options, const ConnectionLimits& limits, ListeningSockets sockets);
  ~AcceptLoop();
  AcceptLoop(const AcceptLoop&) = delete;
  AcceptLoop& operator=(const AcceptLoop&) = delete;

  /// Before Begin. Errors: kResourceExhausted (no descriptor is free).
  Result<void> Prepare();
  // As those of Listener.
  Result<void> Begin(Listener::HandOver hand_over);
  void Close();
  const std::string& address() const { return address_; }
  const ListenerCounts& counts() const { return counts_; }
  void MarkAuthorized(const std::string& peer);
  std::shared_ptr<const SharedSocket> SocketOf(const std::string& peer) const;
  /// Ends the thread.
  void Join();

 private:
  using Id = ConnectionTable::Id;

  void Run(const std::stop_token& stop);
  void Round();
  void Accept(int listening);
  void Take(int fd, const sockaddr_storage& from);
  void StopListening();
  void OnFull();
  void End(Id id);
  void EndForAnother(Id id);
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
  const ListenerOptions options_;
  Listener::HandOver hand_over_;
  const std::string address_;
  int poll_ = -1, wake_ = -1;

  std::atomic<bool> closing_ = false, closed_ = false;
  ListenerCounts counts_;

  struct HandedOver {
    std::shared_ptr<GuardedConnection> guard;
    std::shared_ptr<const SharedSocket> socket;  // null: not of TCP
  };
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  ConnectionTable table_;
  std::vector<Id> violators_;  // to be punished
  std::map<Id, HandedOver> handed_over_;

  // Used by the thread, once it runs.
  struct Connection {
    std::shared_ptr<const SharedSocket> watch;  // epoll reports when both directions are closed
    int fd = -1;                                // gRPC's number, for ReadGuard; or pending
    std::string peer;
  };
  ListeningSockets sockets_;
  std::map<Id, Connection> connections_;
  std::deque<Id> pending_;   // not handed over yet
  int64_t next_due_ns_ = 0;  // of a pending one; 0: none
  int spare_ = -1;           // given up to refuse a connection where descriptors have run out

  std::jthread thread_;
};

}  // namespace taclink::server
